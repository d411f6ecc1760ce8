// See beam.h. Which shapes are about a stretch of the way ahead of the rays, and which of them is the nearest.
#include "beam.h"
#include "numerics.h"
#include "seek.h"

// Radius of a vicinity at least, in radii of the nodes above the shapes, and beside the distance that the nearest shape is
// no further than. HISTORY.md has what others cost.
#define VICINITY 0.4f
#define WIDER 1.2f
// How much of that distance a ray leaves to the vicinity's edge, at least: it has room for a step.
#define MARGIN 0.4f
// How far ahead of the ray behind all others it starts, as a share of what leaves that one a step: all of them go on.
#define AHEAD 0.6f
// How long its stretch is, in the same radii: rays that go the same way stay in it for several steps.
#define LENGTH 0.7f

static inline vmask within_reach(struct vec centre, vfloat radius, const void *with) {
    COUNT(within_reach, call);
    const struct vicinity *v = with;
    struct vec off = vec_off(v, centre);
    vfloat r = v_splat(v->within) + radius;
    return v_cmp_lt(vec_dot(off, off), r * r);
}

static void find_close_by(struct beam *beam, float slack, const struct prepared *scene) {
    COUNT(find_close_by, call);
    COUNT(find_close_by, scalar);
    struct vicinity *v = &beam->near;
    const float *place = beam->place;
    struct vicinity around = *v;
    around.start = (struct vec){v->start.x + v_splat(place[0]), v->start.y + v_splat(place[1]),
                                v->start.z + v_splat(place[2])};
    around.within = v->within * (1 + 1e-4f) + slack;
    v->solids = list_those(&scene->tree, within_reach, &around, v->list);
    v->count = and_planes(scene, v->list, v->solids);
    for (int k = 0; k < v->count; k++) {
        COUNT(find_close_by, shape);
        const struct placed *s = &scene->placed[v->list[k]];
        v->shapes[k].shape = s;
        v->shapes[k].bound = s->way == LINEAR ? INFINITY : s->bound;
        for (int i = 0; i < 3; i++)
            v->shapes[k].place[i] = s->position[i] - place[i];
    }
}

void vicinity_about(struct beam *beam, const struct walk *w, vfloat h, vmask last,
                    const struct convex *work) {
    ACTIVE(v_count(last));
    COUNT(vicinity_about, call);
    COUNT(vicinity_about, scalar);
    const struct prepared *scene = work->scene;
    struct vicinity *v = &beam->near;
    struct vec p = vec_along(w->from, w->rays.to_light, w->march.t), l = w->rays.to_light;
    int one = __builtin_ctz(v_mask_bits(last));
    float near = lane_of(h, one), left = lane_of(w->march.end - w->march.t, one);
    v->within = larger(WIDER * near, VICINITY * scene->tree.spacing);
    float slack = 1e-6f * (float)scene->model.march.bounds_radius;
    float on = larger(AHEAD * (v->within - near) - 2 * slack, 0.0f); // it must not wait itself
    struct vec ahead = vec_along(p, l, v_splat(on));
    v->start = vec_of_lane(&ahead, one);
    v->along = vec_of_lane(&l, one);
    float most = LENGTH * scene->tree.spacing, rest = left - on;
    v->length = larger(rest < most ? rest : most, 0.0f);
    v->room = v->within - MARGIN * near;
    find_close_by(beam, slack, scene);
    for (int i = 0; i < beam->count; i++) {
        struct walk *each = &beam->walk[i];
        ACTIVE(LANES - v_count(each->march.done));
        COUNT(vicinity_about, packet);
        struct vec at = vec_along(each->from, each->rays.to_light, each->march.t);
        each->waits = v_cmp_ge(distance_off(v, at), v_splat(v->room));
    }
}

static inline struct vec from_centre(const struct close_by *c, struct vec at) {
    return (struct vec){at.x - v_splat(c->place[0]), at.y - v_splat(c->place[1]),
                        at.z - v_splat(c->place[2])};
}

// How far the solid's bounding sphere is, whose centre is `square` away squared, by an approximate root, to 10 bits and less by
// that much; and what it is not below further on: a distance to what is convex is a convex function along a ray, so that it
// stays above its tangent.
static inline vfloat surely_off(const struct close_by *c, const struct walk *w, struct vec from,
                                vfloat square, struct below *below) {
    COUNT(surely_off, call);
    square = v_max(square, v_splat(1e-30f));
    vfloat guess = root_guess(square);
    vfloat far = square * guess * v_splat(1 - 0x1p-10f) - v_splat(c->bound);
    below->slope = v_msub(vec_dot(from, w->rays.to_light), guess, v_splat(0x1p-10f));
    below->rest = v_nmadd(below->slope + v_splat(0x1p-18f), w->march.t, far);
    return far;
}

static inline vfloat beginning(const struct walk *w) {
    return v_select(stands_still(w), v_splat(-INFINITY), v_splat(INFINITY));
}

void vicinity_below(struct beam *beam) {
    COUNT(vicinity_below, call);
    struct vicinity *v = &beam->near;
    for (int i = 0; i < beam->moving; i++) {
        struct walk *w = &beam->walk[i];
        ACTIVE(LANES - v_count(stands_still(w)));
        COUNT(vicinity_below, packet);
        w->at = vec_along(w->from, w->rays.to_light, w->march.t);
        vfloat nearest = beginning(w);
        struct below *below = v->below + i;
        int recent = 0, solids = v->solids;
        const struct close_by *shapes = v->shapes;
        for (int k = 0; k < solids; k++, below += BEAM) {
            COUNT(vicinity_below, shape);
            struct vec from = from_centre(&shapes[k], w->at);
            vfloat far = surely_off(&shapes[k], w, from, vec_dot(from, from), below);
            recent = v_any(v_cmp_lt(far, nearest)) ? k : recent;
            nearest = v_min(far, nearest);
        }
        w->recent = recent;
        for (int k = solids; k < v->count; k++, below += BEAM)
            *below = (struct below){v_splat(-INFINITY), v_splat(0.0f)};
    }
}

// Of rays that are from the solid, as exactly as its own frame allows: near to it a sphere's distance in float is noise in the
// third digit, that of its power is not.
static vfloat own_distance(const struct walk *w, const struct placed *s) {
    COUNT(own_distance, call);
    vfloat t = w->march.t;
    if (s->type != SHAPE_SPHERE) {
        COUNT(own_distance, other);
        return distance_at(vec_along(w->rays.local, w->local_to, t), s, v_mask_none());
    }
    COUNT(own_distance, sphere);
    vfloat slope = v_splat(2.0f) * vec_dot(w->rays.local, w->local_to), power = t * (t + slope);
    return power / (v_sqrt(v_max(power + v_splat(s->bound_sq), v_splat(0.0f))) + v_splat(s->a));
}

static inline vfloat distance_to(const struct close_by *c, const struct walk *w) {
    COUNT(distance_to, call);
    const struct placed *s = c->shape;
    if (s->way == LINEAR) {
        COUNT(distance_to, plane);
        return height_along(s, v_and(w->rays.active, same_shape(w->rays.shape, (int)s->index)), w);
    }
    if ((int)s->index == w->solid)
        return own_distance(w, s);
    COUNT(distance_to, solid);
    struct vec p = turned(s, from_centre(c, w->at));
    // Spheres (of no size but their radius) and boxes (of radius 0) by one formula: a branch on which it is is foretold by
    // nothing.
    if (s->type == SHAPE_SPHERE || s->type == SHAPE_BOX || s->type == SHAPE_ROUNDED_BOX)
        return sdf_rounded_box(p, s);
    return distance_at(p, s, v_mask_none());
}

// c: shape k of the vicinity. Its distance falls no faster than t grows; 2^-18: of rounding.
static inline void ask_about(const struct close_by *c, int k, struct walk *w, struct below *below) {
    COUNT(ask_about, call);
    vfloat h = distance_to(c, w);
    *below = (struct below){(h + w->march.t) * v_splat(1.0f - 0x1p-18f), v_splat(-1.0f)};
    int kept = v_any(v_cmp_lt(h, w->least)) - 1; // no branch: it would wait for the root
    w->recent = (w->recent & kept) | (k & ~kept);
    w->least = v_min(h, w->least);
}

// Whether the bounding sphere alone says that no ray is as near to the shape as to what is known, told by squares, without a
// root; and what is known of it then.
static inline bool too_far(const struct close_by *c, const struct walk *w, struct below *below) {
    COUNT(too_far, call);
    struct vec from = from_centre(c, w->at);
    vfloat square = vec_dot(from, from);
    vfloat reach = v_madd(w->march.t, v_splat(0x1p-18f), w->least + v_splat(c->bound));
    reach = v_max(reach, v_splat(0.0f)); // 0 of rays that stand still
    surely_off(c, w, from, square, below);
    return !v_any(v_cmp_ge(reach * reach, square * v_splat(1 - 0x1p-16f))); // so it is of no plane
}

enum { AT_ONCE = 64 }; // shapes, of each a bit

static inline vfloat may_be(const struct below *below, vfloat t) {
    return v_madd(below->slope, t, below->rest);
}

// Of the shapes from `first` on, AT_ONCE at most, the bits of those that may be nearer to one of a packet's rays than what is.
static inline unsigned long long wake(const struct below *below, int count, const struct walk *w) {
    COUNT(wake, call);
    vfloat least = w->least, t = w->march.t;
    unsigned long long awake = 0;
    for (int k = 0; k < count;
         k += 4, below += 4 * BEAM) { // what is read behind the last is of no shape
        COUNT(wake, four);
        unsigned long long which = v_any_of_four(v_cmp_ge(least, may_be(&below[0], t)),
                                                 v_cmp_ge(least, may_be(&below[BEAM], t)),
                                                 v_cmp_ge(least, may_be(&below[2 * BEAM], t)),
                                                 v_cmp_ge(least, may_be(&below[3 * BEAM], t)));
        awake |= which << k;
    }
    return count < AT_ONCE ? awake & ((1ull << count) - 1) : awake;
}

// The shape that was the nearest is asked first. Then each thing is done for all packets, one after the other: which shapes
// may be nearer, which of those their bounding spheres leave, and how far those are: a branch on one shape's distance would
// wait for it, and is foretold by nothing.
void vicinity_nearest(struct beam *beam) {
    COUNT(vicinity_nearest, call);
    const struct vicinity *v = &beam->near;
    const struct close_by *shapes = v->shapes; // what is stored may not change it
    unsigned long long which[BEAM];            // of AT_ONCE shapes
    int asked[BEAM];
    unsigned walking = 0;
    for (int i = 0; i < beam->moving; i++) {
        struct walk *w = &beam->walk[i];
        if (v_all(stands_still(w)))
            continue;
        ACTIVE(LANES - v_count(stands_still(w)));
        COUNT(vicinity_nearest, packet);
        walking |= 1u << i;
        w->at = vec_along(w->from, w->rays.to_light, w->march.t);
        w->least = beginning(w);
        asked[i] = w->recent;
        if (v->count > 0)
            ask_about(&shapes[w->recent], w->recent, w, &v->below[w->recent * BEAM + i]);
    }
    for (int first = 0; first < v->count; first += AT_ONCE) {
        const struct close_by *these = &shapes[first];
        struct below *below = &v->below[first * BEAM];
        for (unsigned packets = walking; packets; packets &= packets - 1) {
            int i = __builtin_ctz(packets);
            const struct walk *w = &beam->walk[i];
            ACTIVE(LANES - v_count(stands_still(w)));
            unsigned once = (unsigned)(asked[i] - first); // more than there are, of another row
            which[i] = wake(&below[i], lesser(v->count - first, AT_ONCE), w);
            which[i] &= ~(once < AT_ONCE ? 1ull << once : 0);
        }
        for (unsigned packets = walking; packets; packets &= packets - 1) {
            int i = __builtin_ctz(packets);
            const struct walk *w = &beam->walk[i];
            ACTIVE(LANES - v_count(stands_still(w)));
            unsigned long long near = 0;
            for (unsigned long long rest = which[i]; rest; rest &= rest - 1) {
                int k = __builtin_ctzll(rest);
                near |= (unsigned long long)!too_far(&these[k], w, &below[k * BEAM + i]) << k;
            }
            which[i] = near;
        }
        for (unsigned packets = walking; packets; packets &= packets - 1) {
            int i = __builtin_ctz(packets);
            struct walk *w = &beam->walk[i];
            ACTIVE(LANES - v_count(stands_still(w)));
            for (unsigned long long rest = which[i]; rest; rest &= rest - 1) {
                int k = __builtin_ctzll(rest);
                ask_about(&these[k], first + k, w, &below[k * BEAM + i]);
            }
        }
    }
}
