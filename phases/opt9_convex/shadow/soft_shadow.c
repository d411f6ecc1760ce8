// Marches of soft shadow rays, packet by packet: the improved soft shadow of I. Quilez, "soft shadows in
// raymarched SDFs" (iquilezles.org/articles/rmshadows), after S. Aaltonen's GDC 2018 talk. Only shapes that
// can be the nearest are evaluated (shadow/shadow_candidates.c). Rays from a plane leap over their first
// steps.
#include "shadow/soft_shadow.h"
#include "bvh/bvh_lists.h"
#include "shadow/shadow_cone.h"
#include "simd/simd.h"

// Lowers *least to the distance to shape i, unless the shape sleeps. A distance falls no faster than t grows,
// so a shape at distance h at t sleeps while the nearest distance + t is below h + t then (PROOFS.md, 5.).
// The factor 1 − 2^-18 covers rounding. Before candidate->from it sleeps in any case.
__attribute__((always_inline)) static inline void
candidate_distance(int i, struct shadow_candidate *candidates, vfloat t, vmask done,
                   const struct known_scene *scene, vfloat *least) {
    struct shadow_candidate *candidate = &candidates[i];
    if (scene->primitives[i].eval == EVAL_LINEAR) { // cheaper than the test for sleep
        *least = v_min(*least, v_madd(t, candidate->direction.x, candidate->origin.x));
        return;
    }
    ACTIVE(LANES - v_count(done));
    COUNT(candidate, call);
    vmask awake = v_cmp_ge_in(v_not(done), *least + t, candidate->wake_bound);
    if (!v_any(v_cmp_ge_in(awake, t, candidate->from)))
        return;
    COUNT(candidate_awake, call);
    vfloat h = distance_along(candidate, t, &scene->primitives[i]);
    candidate->wake_bound = (h + t) * v_splat(1.0f - 0x1p-18f);
    *least = v_min(*least, h);
}

__attribute__((always_inline)) static inline vfloat
nearest_candidate(struct shadow_candidate *candidates, const struct shape_set *listed, vfloat t,
                  vmask done, const struct prepared *scene) {
    vfloat least = v_splat(INFINITY);
    UNROLL_SHAPES
    for (int k = 0; k < set_end(listed); k++)
        if (set_has(listed, k))
            candidate_distance(set_shape(listed, k), candidates, t, done, KNOWN(scene), &least);
    return least;
}

// Leaps over the first steps of rays from a plane. Until another shape is nearer, t grows by 1 + facing a
// step, the first term is strength·facing, and all others are equal (PROOFS.md, 16.). A ray that leaves the
// bounds is done and keeps the terms so far.
#define STEEP_FACING 0.5f
static inline void leap_to_candidate(const struct shadow_rays *r, struct shadow_march *m,
                                     const struct known_scene *scene, vfloat start, vfloat strength,
                                     vfloat hit_distance) {
    vfloat one = v_splat(1.0f), zero = v_splat(0.0f),
           until = v_min(r->leap_limit, r->end) * v_splat(1.0f - 1e-5f);
    vmask can = v_and(v_and(r->on_plane, r->active), v_cmp_ge(until, start));
    // A march that is within the hit distance at its first step has no term at all.
    can = v_and(can, v_cmp_ge(start * r->facing, hit_distance));
    if (!v_any(can))
        return;
    // Leap no further than to the bounds: `until` may be infinite.
    vfloat half = m->linear * v_splat(-0.5f);
    until = v_min(until, half + v_sqrt(v_max(v_msub(half, half, m->constant), zero)));
    can = v_and(can, v_cmp_ge(until, start));
    vfloat c = r->facing, t = start;
    if (!v_any(
            v_and(can, v_cmp_lt(c, v_splat(STEEP_FACING > scene->lit_slope ? STEEP_FACING
                                                                           : scene->lit_slope))))) {
        // A high light: no term of these steps is below 1, and the steps are few.
        vfloat before = start, grown = one + c;
        for (vmask on = can; v_any(on); on = v_and(on, v_cmp_ge(until, t))) {
            before = v_select(on, t, before);
            t = v_select(on, t * grown, t);
        }
        m->previous = v_select(can, before * c, m->previous);
    } else {
        vfloat grow = v_log(one + c);
        vfloat steps = v_floor(v_log(v_max(until, start) / start) / grow) + one;
        vfloat first = strength * c, ratio = v_splat(0.5f) * (one + c);
        t = start * v_exp(steps * grow);
        vfloat inside = v_nmadd(ratio, ratio, one), beyond = v_nmadd(c, ratio, one);
        vfloat others = first * first * inside / (beyond * beyond);
        vfloat least = v_min(first * first, v_select(v_cmp_gt(steps, v_splat(1.5f)), others, one));
        m->square = v_select(can, v_min(m->square, least), m->square);
        m->previous = v_select(can, t * c / (one + c), m->previous);
    }
    m->t = v_select(can, t, start);
    vmask left = v_cmp_gt(v_madd(m->t, m->t + m->linear, m->constant), zero);
    m->done = v_or(m->done, v_and(can, left));
}

// Removes from *dark the rays that meet a Mandelbulb's bounding sphere. Such a march may end inside it, so
// shapes further on say nothing.
INLINE void misses_bulb(int i, const struct shadow_rays *r, const struct known_scene *scene,
                        vmask *dark) {
    const struct primitive *s = &scene->primitives[i];
    if (s->type != SHAPE_MANDELBULB)
        return;
    struct vec v = to_centre(s, r->point);
    vfloat along = v_max(vec_dot(v, r->to_light), v_splat(0.0f));
    *dark = v_and(*dark, v_cmp_lt(along * along, vec_dot(v, v) - v_splat(s->bound_sq)));
}

// Returns the rays that are dark without a march (PROOFS.md, 4.). The steps towards an entry at this cosine
// shrink to 1 − cosine of the one before, so the last term is below strength·hit_distance/((1 − cosine)·t).
// Where that is at most 1e-4, 0 is written. The ray must take its first step, at `offset`, enter within the
// bounds, and have the steps to get there: e^-23 is 1e-10.
__attribute__((__always_inline__)) static inline vmask dark_by_proof(const struct shadow_rays *r,
                                                                     const struct shadow_march *m,
                                                                     vfloat offset, vfloat hit,
                                                                     const struct prepared *scene) {
    const struct limits *march = &scene->model.march;
    vfloat room = r->first * (v_splat(1.0f) - r->cosine);
    double least_room = 1e4 * march->hit_distance * KNOWN(scene)->model.shadow_strength;
    if (least_room < march->surface_offset)
        least_room = march->surface_offset;
    vmask there = v_cmp_ge(v_splat(0.0f), v_madd(r->first, r->first + m->linear, m->constant));
    vmask dark = v_and(v_and(v_and(r->active, there), v_cmp_gt(room, v_splat((float)least_room))),
                       v_cmp_lt(r->first, r->end));
    float least_cosine =
        march->max_steps < LEAP_MIN_MAX_STEPS ? INFINITY : 23.0f / (float)march->max_steps;
    dark = v_and(
        dark, v_and(v_cmp_gt(r->cosine, v_splat(least_cosine)), v_cmp_ge(r->facing * offset, hit)));
    if (KNOWN(scene)->bulbs) {
        UNROLL_SHAPES
        for (int i = 0; i < KNOWN(scene)->model.shape_count; i++)
            misses_bulb(i, r, KNOWN(scene), &dark);
    }
    return dark;
}

KERNEL_SHARED void begin_march(struct shadow_rays *r, struct shadow_candidate *candidates,
                               struct shape_set *listed, const struct tile_context *work,
                               struct shadow_march *m) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    m->candidates = candidates;
    m->listed = listed;
    m->previous = v_splat(1e9f);
    m->step_began = v_splat(0.0f);
    m->divisor = v_splat(1.0f);
    r->sharp = v_splat(8 * EDGE_FACTOR * (float)work->scene->model.march.hit_distance);
    if (HAS_BVH(work->scene))
        bvh_first_entry(r, candidates, work);
    else
        list_candidates(r, candidates, listed, work);
    m->end = KNOWN(work->scene)->bulbs
                 ? v_splat(INFINITY)
                 : r->end; // with a Mandelbulb: is_behind_all(), plane_is_nearest_for_good()
    float radius = (float)model->march.bounds_radius;
    m->linear = v_splat(2.0f) * vec_dot(r->point, r->to_light);
    m->constant = vec_dot(r->point, r->point) - v_splat(radius * radius * (1.0f + 0x1p-20f));
    const struct limits *march = &work->scene->model.march;
    vfloat offset = v_splat((float)model->march.surface_offset),
           hit = v_splat((float)march->hit_distance);
    vmask dark = dark_by_proof(r, m, offset, hit, work->scene);
    m->done = v_or(dark, v_not(r->active));
    m->square = v_zero_where(dark, v_splat(1.0f));
    m->t = offset;
    if (!HAS_BVH(work->scene) && march->max_steps >= LEAP_MIN_MAX_STEPS)
        leap_to_candidate(r, m, KNOWN(work->scene), offset, v_splat((float)model->shadow_strength),
                          hit);
    m->sole_solid = v_mask_none();
    if (r->from_planes && !KNOWN(work->scene)->bulbs &&
        !KNOWN(work->scene)->repeats) { // a copy may come nearer later
        m->sole_solid = v_andnot(
            v_or(r->meets_many, v_cmp_lt(r->facing, v_splat(KNOWN(work->scene)->lit_slope))),
            r->active);
    }
}

// A packet in work. first: index of its first ray in the queue.
struct packet_march {
    struct shadow_march march;
    vmask active;
    int first, steps;
    bool over;
};

// Starts the packet at queue index `next`, if there is one. Returns the index behind it.
static int begin_packet(struct packet_march *c, int slot, int next,
                        const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    c->over = next >= scratch->shadows;
    c->first = c->over ? -1 : next;
    if (c->over)
        return next;
    struct shadow_rays r;
    load_shadow_packet(scratch->shadow, next, scratch->shadows, &r);
    begin_march(&r, scratch->candidates + slot * KNOWN(work->scene)->model.shape_count,
                &scratch->listed[slot], work, &c->march);
    c->active = r.active;
    c->steps = work->scene->model.march.max_steps;
    return next + LANES;
}

// Ends rays past their minimum, if one convex solid alone can darken them (PROOFS.md, 6.). The distance to a
// convex solid is a convex function of t, so its ratio to t falls and then rises. If the ratio was below q =
// lit_slope at `from` and has risen since, it stays above its present value r, and no later term is below
// strength·√¾·r. Rays with a smaller term end.
static inline void end_past_minimum(struct shadow_march *m, vfloat from, vfloat before, float q,
                                    vfloat enough) {
    vfloat h = m->previous, t = m->step_began;
    vmask risen =
        v_cmp_ge_in(v_cmp_lt_in(m->sole_solid, before, v_splat(q) * from), h * from, before * t);
    vfloat least = m->square * (t * t), now = m->divisor * (h * h);
    m->done = v_or(m->done, v_cmp_lt_in(risen, least, now * enough));
}

static void end_packet(const struct packet_march *c, struct worker_scratch *scratch) {
    float (*field)[QUEUE_ROOM] = scratch->shadow;
    vfloat lit = v_sqrt(c->march.square / c->march.divisor);
    add_light(c->active, vec_scale(load_vec(field + S_LIGHT, c->first), lit),
              v_load(&field[S_PIXEL][c->first]), scratch);
}

// Marches PACKETS_IN_WORK packets in turns: a step waits for several roots in a row. With REFILL_PACKETS, a
// packet that ends is replaced at once. Else all end first, and add their light in the queue's order.
void cast_packets(const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    const struct prepared *scene = work->scene;
    vfloat strength = v_splat((float)KNOWN(scene)->model.shadow_strength),
           hit = v_splat((float)scene->model.march.hit_distance);
    vfloat enough = strength * strength * v_splat(0.7499f); // ¾, with a margin for rounding
    struct packet_march cast[PACKETS_IN_WORK];
    for (int next = 0; next < scratch->shadows;) {
        int live = PACKETS_IN_WORK;
        for (int k = 0; k < PACKETS_IN_WORK; k++) {
            next = begin_packet(&cast[k], k, next, work);
            live -= cast[k].over;
        }
        while (live > 0)
            for (int k = 0; k < PACKETS_IN_WORK; k++) {
                struct packet_march *c = &cast[k];
                if (c->over)
                    continue;
                struct shadow_march *m = &c->march;
                if (c->steps-- > 0 && !v_all(m->done)) {
                    vfloat from = m->step_began, before = m->previous;
                    shadow_step(m,
                                nearest_candidate(m->candidates, m->listed, m->t, m->done, scene),
                                strength, hit, 0.0f);
                    end_past_minimum(m, from, before, KNOWN(scene)->lit_slope, enough);
                    continue;
                }
                c->over = true;
                if (REFILL_PACKETS) {
                    end_packet(c, scratch);
                    next = begin_packet(c, k, next, work);
                }
                live -= c->over;
            }
        for (int k = 0; k < PACKETS_IN_WORK && !REFILL_PACKETS; k++)
            if (cast[k].first >= 0)
                end_packet(&cast[k], scratch);
    }
    scratch->shadows = 0;
}
