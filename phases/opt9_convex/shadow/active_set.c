// The active set of a batch: all shapes near a segment ahead of the rays, and the nearest of them to each
// ray.
#include "bvh/bvh_traversal.h"
#include "shadow/shadow_batch.h"

// The radius of an active set is at least ACTIVE_RADIUS·bvh.spacing and ACTIVE_GROWTH times the bound of the
// nearest distance. (Other values: docs/what-did-not-pay.md.)
#define ACTIVE_RADIUS 0.4f
#define ACTIVE_GROWTH 1.2f
// A ray in the set is at least this share of that bound inside its edge: room for a step.
#define ACTIVE_MARGIN 0.4f
// The set starts ahead of the last ray, by this share of the room that ray has left.
#define ACTIVE_AHEAD 0.6f
// Length of the segment over bvh.spacing. Rays in one direction stay near it for several steps.
#define ACTIVE_LENGTH 0.7f

// Tests which spheres come within `within` of the segment.
static inline vmask near_segment(struct vec centre, vfloat radius, const void *with) {
    const struct active_set *v = with;
    struct vec off = offset_from_segment(v, centre);
    vfloat r = v_splat(v->within) + radius;
    return v_cmp_lt(vec_dot(off, off), r * r);
}

static void list_active(struct shadow_batch *batch, float slack, const struct prepared *scene) {
    struct active_set *v = &batch->set;
    const float *origin = batch->origin;
    struct active_set around = *v;
    around.start = (struct vec){v->start.x + v_splat(origin[0]), v->start.y + v_splat(origin[1]),
                                v->start.z + v_splat(origin[2])};
    around.within = v->within * (1 + 1e-4f) + slack;
    v->solids = bvh_list(&scene->bvh, near_segment, &around, v->list);
    v->count = append_planes(scene, v->list, v->solids);
    for (int k = 0; k < v->count; k++) {
        const struct primitive *s = &scene->primitives[v->list[k]];
        v->shapes[k].shape = s;
        v->shapes[k].bound = s->eval == EVAL_LINEAR ? INFINITY : s->bound;
        for (int i = 0; i < 3; i++)
            v->shapes[k].centre[i] = s->position[i] - origin[i];
    }
}

void set_active_set(struct shadow_batch *batch, const struct batch_packet *w, vfloat h, vmask last,
                    const struct tile_context *work) {
    const struct prepared *scene = work->scene;
    struct active_set *v = &batch->set;
    struct vec p = vec_along(w->start, w->rays.to_light, w->march.t), l = w->rays.to_light;
    int one = __builtin_ctz(v_mask_bits(last));
    float near = lane_of(h, one), left = lane_of(w->march.end - w->march.t, one);
    v->within = float_max(ACTIVE_GROWTH * near, ACTIVE_RADIUS * scene->bvh.spacing);
    float slack = 1e-6f * (float)scene->model.march.bounds_radius;
    float on = float_max(ACTIVE_AHEAD * (v->within - near) - 2 * slack,
                         0.0f); // so that the last ray itself can step
    struct vec ahead = vec_along(p, l, v_splat(on));
    v->start = vec_of_lane(&ahead, one);
    v->along = vec_of_lane(&l, one);
    float most = ACTIVE_LENGTH * scene->bvh.spacing, rest = left - on;
    v->length = float_max(rest < most ? rest : most, 0.0f);
    v->room = v->within - ACTIVE_MARGIN * near;
    list_active(batch, slack, scene);
    for (int i = 0; i < batch->count; i++) {
        struct batch_packet *each = &batch->packet[i];
        struct vec at = vec_along(each->start, each->rays.to_light, each->march.t);
        each->waits = v_cmp_ge(distance_from_segment(v, at), v_splat(v->room));
    }
}

static inline struct vec offset_from_candidate(const struct candidate *c, struct vec at) {
    return vec_sub(at, vec_set(c->centre));
}

// Returns the distance to a bounding sphere whose centre is √square away, rounded down by 2^-10 for the root.
// Sets the falling bound: a distance to a convex set is convex along a ray, so it stays above its tangent.
static inline vfloat sphere_bound(const struct candidate *c, const struct batch_packet *w,
                                  struct vec from, vfloat square, struct falling_bound *below) {
    square = v_max(square, v_splat(1e-30f));
    vfloat guess = v_rsqrt_approx(square);
    vfloat far = square * guess * v_splat(1 - 0x1p-10f) - v_splat(c->bound);
    below->slope = v_msub(vec_dot(from, w->rays.to_light), guess, v_splat(0x1p-10f));
    below->intercept = v_nmadd(below->slope + v_splat(0x1p-18f), w->march.t, far);
    return far;
}

static inline vfloat idle_or_infinite(const struct batch_packet *w) {
    return v_select(is_idle(w), v_splat(-INFINITY), v_splat(INFINITY));
}

void set_falling_bounds(struct shadow_batch *batch) {
    struct active_set *v = &batch->set;
    for (int i = 0; i < batch->moving; i++) {
        struct batch_packet *w = &batch->packet[i];
        w->at = vec_along(w->start, w->rays.to_light, w->march.t);
        vfloat nearest = idle_or_infinite(w);
        struct falling_bound *below = v->below + i;
        int recent = 0, solids = v->solids;
        const struct candidate *shapes = v->shapes;
        for (int k = 0; k < solids; k++, below += BATCH_PACKETS) {
            struct vec from = offset_from_candidate(&shapes[k], w->at);
            vfloat far = sphere_bound(&shapes[k], w, from, vec_dot(from, from), below);
            recent = v_any(v_cmp_lt(far, nearest)) ? k : recent;
            nearest = v_min(far, nearest);
        }
        w->recent = recent;
        for (int k = solids; k < v->count; k++, below += BATCH_PACKETS)
            *below = (struct falling_bound){v_splat(-INFINITY), v_splat(0.0f)};
    }
}

// Returns the distance to the rays' own solid, in its own frame. Near it a sphere's distance in float errs in
// the third digit; its power does not.
static vfloat distance_to_own_solid(const struct batch_packet *w, const struct primitive *s) {
    vfloat t = w->march.t;
    if (s->type != SHAPE_SPHERE)
        return distance_at(vec_along(w->rays.local, w->local_to, t), s, v_mask_none());
    vfloat slope = v_splat(2.0f) * vec_dot(w->rays.local, w->local_to), power = t * (t + slope);
    return power / (v_sqrt(v_max(power + v_splat(s->bound_sq), v_splat(0.0f))) + v_splat(s->a));
}

static inline vfloat distance_to(const struct candidate *c, const struct batch_packet *w) {
    const struct primitive *s = c->shape;
    if (s->eval == EVAL_LINEAR)
        return plane_height(s, v_and(w->rays.active, is_shape(w->rays.shape, (int)s->index)), w);
    COUNT(candidate_active, call);
    if ((int)s->index == w->solid)
        return distance_to_own_solid(w, s);
    struct vec p = turned(s, offset_from_candidate(c, w->at));
    // Spheres (size 0) and boxes (radius 0) by one formula: a branch on the type would be unpredictable.
    if (s->type == SHAPE_SPHERE || s->type == SHAPE_BOX || s->type == SHAPE_ROUNDED_BOX)
        return sdf_rounded_box(p, s);
    return distance_at(p, s, v_mask_none());
}

// Evaluates shape k of the active set. Its falling bound has slope −1; the factor 1 − 2^-18 covers rounding.
static inline void evaluate_candidate(const struct candidate *c, int k, struct batch_packet *w,
                                      struct falling_bound *below) {
    ACTIVE(LANES - v_count(is_idle(w)));
    vfloat h = distance_to(c, w);
    *below = (struct falling_bound){(h + w->march.t) * v_splat(1.0f - 0x1p-18f), v_splat(-1.0f)};
    int kept = v_any(v_cmp_lt(h, w->least)) - 1; // branch-free: a branch would wait for the root
    w->recent = (w->recent & kept) | (k & ~kept);
    w->least = v_min(h, w->least);
}

// Returns whether the bounding sphere proves that the shape is nearest to no ray. Compares squares, without a
// root. Sets the falling bound.
static inline bool sphere_too_far(const struct candidate *c, const struct batch_packet *w,
                                  struct falling_bound *below) {
    struct vec from = offset_from_candidate(c, w->at);
    vfloat square = vec_dot(from, from);
    vfloat reach = v_madd(w->march.t, v_splat(0x1p-18f), w->least + v_splat(c->bound));
    reach = v_max(reach, v_splat(0.0f)); // 0 for idle rays
    sphere_bound(c, w, from, square, below);
    return !v_any(
        v_cmp_ge(reach * reach, square * v_splat(1 - 0x1p-16f))); // never true for a plane
}

enum { WAKE_BITS = 64 }; // shapes in a word, a bit for each

static inline vfloat falling_bound_at(const struct falling_bound *below, vfloat t) {
    return v_madd(below->slope, t, below->intercept);
}

// Returns the shapes that may be nearer to some ray than the nearest so far, as bits. count: WAKE_BITS at
// most.
static inline unsigned long long awake_candidates(const struct falling_bound *below, int count,
                                                  const struct batch_packet *w) {
    vfloat least = w->least, t = w->march.t;
    unsigned long long awake = 0;
    for (int k = 0; k < count;
         k += 4, below += 4 * BATCH_PACKETS) { // entries past the last shape are masked out below
        unsigned long long which =
            v_any_of_four(v_cmp_ge(least, falling_bound_at(&below[0], t)),
                          v_cmp_ge(least, falling_bound_at(&below[BATCH_PACKETS], t)),
                          v_cmp_ge(least, falling_bound_at(&below[2 * BATCH_PACKETS], t)),
                          v_cmp_ge(least, falling_bound_at(&below[3 * BATCH_PACKETS], t)));
        awake |= which << k;
    }
    return count < WAKE_BITS ? awake & ((1ull << count) - 1) : awake;
}

// Evaluates the shape that was nearest last, then three passes over all packets: which shapes may be nearer,
// which of those survive the bounding sphere test, and their distances. Passes avoid branches on single
// distances, which wait for their roots and are unpredictable.
void active_nearest(struct shadow_batch *batch) {
    const struct active_set *v = &batch->set;
    const struct candidate *shapes = v->shapes; // a copy: stores to packets may not alias it
    unsigned long long which[BATCH_PACKETS];    // WAKE_BITS shapes each
    int tested[BATCH_PACKETS];
    unsigned walking = 0;
    for (int i = 0; i < batch->moving; i++) {
        struct batch_packet *w = &batch->packet[i];
        if (v_all(is_idle(w)))
            continue;
        walking |= 1u << i;
        w->at = vec_along(w->start, w->rays.to_light, w->march.t);
        w->least = idle_or_infinite(w);
        tested[i] = w->recent;
        if (v->count > 0)
            evaluate_candidate(&shapes[w->recent], w->recent, w,
                               &v->below[w->recent * BATCH_PACKETS + i]);
    }
    for (int first = 0; first < v->count; first += WAKE_BITS) {
        const struct candidate *these = &shapes[first];
        struct falling_bound *below = &v->below[first * BATCH_PACKETS];
        for (unsigned packets = walking; packets; packets &= packets - 1) {
            int i = __builtin_ctz(packets);
            const struct batch_packet *w = &batch->packet[i];
            unsigned once =
                (unsigned)(tested[i] - first); // beyond WAKE_BITS if it is in another word
            which[i] = awake_candidates(&below[i], int_min(v->count - first, WAKE_BITS), w);
            which[i] &= ~(once < WAKE_BITS ? 1ull << once : 0);
        }
        for (unsigned packets = walking; packets; packets &= packets - 1) {
            int i = __builtin_ctz(packets);
            const struct batch_packet *w = &batch->packet[i];
            unsigned long long near = 0;
            for (unsigned long long rest = which[i]; rest; rest &= rest - 1) {
                int k = __builtin_ctzll(rest);
                near |=
                    (unsigned long long)!sphere_too_far(&these[k], w, &below[k * BATCH_PACKETS + i])
                    << k;
            }
            which[i] = near;
        }
        for (unsigned packets = walking; packets; packets &= packets - 1) {
            int i = __builtin_ctz(packets);
            struct batch_packet *w = &batch->packet[i];
            for (unsigned long long rest = which[i]; rest; rest &= rest - 1) {
                int k = __builtin_ctzll(rest);
                evaluate_candidate(&these[k], first + k, w, &below[k * BATCH_PACKETS + i]);
            }
        }
    }
}
