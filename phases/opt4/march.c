// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). A packet marches until its last ray is done.
#include "trace.h"

#include <limits.h>

// When a ray leaves the bounds: |o + t·d|² > radius², as a polynomial in t that needs no point. Its
// rounding error is a few 2^-24 of radius². The constant has 2^-20 to spare, so that no ray leaves too
// early; within() decides about a hit in that margin.
struct exit {
    vfloat linear, constant; // the ray is outside where t·(t + linear) + constant > 0
};

static struct exit leaving(struct point origin, struct vec direction, const struct model *model) {
    COUNT(leaving, call);
    COUNT(leaving, scalar);
    float radius = (float)model->march.bounds_radius;
    struct vec o = origin.hi;
    return (struct exit){v_splat(2.0f) * vec_dot(o, direction),
                         vec_dot(o, o) - v_splat(radius * radius * (1.0f + 0x1p-20f))};
}

// Whether a point is in the bounds, decided in double.
static vmask within(struct point point, const struct model *model) {
    COUNT(within, call);
    COUNT(within, scalar);
    double radius = model->march.bounds_radius;
    return v_cmp_ge(v_splat(0.0f), power_at(vec_double_of(point), radius * radius));
}

static inline vmask outside(struct exit exit, vfloat t) {
    return v_cmp_gt(v_madd(t, t + exit.linear, exit.constant), v_splat(0.0f));
}

// The hit test of a float march. A step below half an ulp of t, at most 2^-24·t, no longer moves the
// ray. It counts as a hit, or the ray would stall there until the step cap.
static inline vmask is_hit(vfloat distance, vfloat t, vfloat hit_distance) {
    return v_cmp_lt(distance, v_max(hit_distance, t * v_splat(0x1p-24f)));
}

// Returns the length of a last Newton step, h/slope: a ray at a grazing angle has more than h left to
// go, 33 times on scene0's plane at the horizon. It returns 0 where |h| is larger than the float
// march's own error, because the scene's hit_distance then allows that gap.
static inline vfloat newton(vfloat h, vfloat slope, vfloat path_length) {
    COUNT(newton, call);
    vmask march_error = v_cmp_lt(v_abs(h), path_length * v_splat(0x1p-21f));
    return v_select_or_zero(march_error, h / v_max(slope, v_splat(0x1p-9f)));
}

// The rays of a packet during the march, at distance start_t + t + last from the camera. t and the
// last step stay apart: their rounded sum would lose the digits that place the hit on the surface.
struct march_state {
    struct point origin; // at the distance start_t
    vfloat start_t, t, last, evals;
    vmask done, found;
    int steps; // the fewest evaluations of any ray that marches on
};

// Marches until every ray has ended. A hit is a hit of the float march, whose error grows with t.
__attribute__((always_inline)) static inline void
march_in(struct march_state *state, struct vec direction, bool groups, const struct world *world) {
    COUNT(march, call);
    const struct prepared *scene = world->scene;
    struct exit exit = leaving(state->origin, direction, &scene->model);
    vfloat hit_distance = v_splat((float)scene->model.march.hit_distance);
    vmask done = state->done, found = state->found;
    vfloat t = v_splat(0.0f), last = t, evals = state->evals;
    for (int step = state->steps; step < scene->model.march.max_steps; step++) {
        ACTIVE(LANES - v_count(done));
        COUNT(march, step);
        vfloat distance = sdf(world->local_rays, t, scene, done, groups, NULL);
        evals = evals + v_zero_where(done, v_splat(1.0f));
        vmask reached = v_andnot(done, is_hit(distance, t, hit_distance));
        last = v_select(reached, distance, last);
        t = t + v_zero_where(v_or(done, reached), distance);
        vmask ended = v_or(reached, v_andnot(done, outside(exit, t)));
        if (v_any(ended)) {
            found = v_or(found, reached);
            done = v_or(done, ended);
            if (v_all(done))
                break;
        }
    }
    *state = (struct march_state){state->origin, state->start_t, t,     last,
                                  evals,         done,           found, state->steps};
}

static void march(struct march_state *state, struct vec direction, const struct world *world) {
    if (world->scene->model.features.groups)
        march_in(state, direction, true, world);
    else
        march_in(state, direction, false, world);
}

// Finds the shape that contains the end of each march in `deep`. The last step goes back out of that
// shape, where another one may be nearer.
__attribute__((noinline)) static void stay_in(vmask deep, vfloat t, const struct world *world,
                                              vfloat *shape) {
    ACTIVE(v_count(deep));
    COUNT(stay_in, call);
    vfloat inside = v_splat(-1.0f);
    sdf(world->local_rays, t, world->scene, v_not(deep), world->scene->model.features.groups,
        &inside);
    *shape = v_select(deep, inside, *shape);
}

// The fewest evaluations of any ray in `on`. The step cap holds for each ray by itself.
static int min_evals(vfloat evals, vmask on) {
    float counts[LANES];
    int fewest = INT_MAX;
    _mm256_storeu_ps(counts, evals);
    for (unsigned lanes = v_mask_bits(on); lanes; lanes &= lanes - 1) {
        int count = (int)counts[__builtin_ctz(lanes)];
        fewest = count < fewest ? count : fewest;
    }
    return fewest;
}

// The last part of ray_march(): fills `hit`, and moves the hits by a last Newton step. `deep`: hits
// that started inside the shape `inside`. Always inlined: it counts as ray_march().
__attribute__((always_inline)) static inline void
finish_hit(const struct march_state *state, struct nearest_shape near, vmask deep, vfloat inside,
           struct vec direction, const struct world *world, struct hit *hit) {
    vfloat path_length = state->start_t + state->t;
    vmask at_start =
        v_cmp_ge(v_splat(0.0f), path_length); // counts as a hit even outside the bounds
    hit->found = v_and(hit->found, v_or(within(state->origin, &world->scene->model), at_start));
    if (v_any(deep)) {
        COUNT(ray_march, deep);
        near.contact =
            v_or(near.contact, v_and(deep, v_cmp_ge(v_abs(near.shape - inside), v_splat(0.5f))));
        near.shape = v_select(deep, inside, near.shape);
    }
    vfloat slope;
    hit->normal = normal_at(direction, hit->found, &near, world, &slope);
    ACTIVE(v_count(hit->found));
    COUNT(ray_march, end);
    hit->shape = v_select(hit->found, near.shape, hit->shape);
    vfloat more = v_zero_where(deep, newton(near.distance, slope, path_length));
    hit->t = state->start_t + (state->t + (state->last + more));
    hit->point = state->origin;
    hit->point.lo = vec_along(hit->point.lo, direction, more);
    local_ray_advance(more, world->scene, world->local_rays);
}

// Each hit becomes the origin of the local rays. There its distance is exact to the size of a shape,
// not of the path to it. A hit that is still farther than twice the hit distance marches on from
// there: the march erred, or its hit test was wider than the scene's.
void ray_march(struct point origin, struct vec direction, vmask active, const struct world *world,
               struct hit *hit) {
    COUNT(ray_march, call);
    COUNT(ray_march, scalar);
    const struct prepared *scene = world->scene;
    float twice = 2.0f * (float)scene->model.march.hit_distance;
    vfloat zero = v_splat(0.0f), max_gap = v_splat(twice), max_depth = v_splat(-twice);
    vfloat max_evals = v_splat((float)scene->model.march.max_steps);
    struct march_state state = {.origin = origin, .start_t = zero, .evals = zero};
    state.found = v_mask_none();
    state.done = v_not(active);
    vmask deep = v_mask_none(); // started inside a shape and has stepped back out of it
    vfloat inside = v_splat(-1.0f);
    struct nearest_shape near = {zero, inside, v_mask_none()};
    local_ray_origins(origin, scene, world->local_rays);
    local_ray_directions(direction, scene, world->local_rays);
    for (;;) {
        vmask settled = state.found;
        march(&state, direction, world);
        if (!v_any(state.found))
            break;
        ACTIVE(v_count(state.found));
        COUNT(ray_march, landed);
        // march() counts steps from the smallest count in the packet: other rays may exceed the cap.
        state.found = v_andnot(v_cmp_gt(state.evals, max_evals), state.found);
        vmask sunk = v_and(state.found, v_cmp_lt(state.last, max_depth));
        if (v_any(sunk))
            stay_in(sunk, state.t, world, &inside);
        deep = v_or(deep, sunk);
        state.origin = place_at(state.origin, direction, state.t, state.last);
        local_ray_origins(state.origin, scene, world->local_rays);
        near = near_hit(state.found, world);
        vmask off =
            v_and(state.found, v_andnot(v_or(deep, settled), v_cmp_gt(near.distance, max_gap)));
        if (!v_any(off))
            break;
        ACTIVE(v_count(off));
        COUNT(ray_march, on);
        // Restart from a point that is certainly before the surface, even one as thin as an ulp of t.
        vfloat back = v_select_or_zero(off, state.t * v_splat(-0x1p-22f));
        state.origin.lo = vec_along(state.origin.lo, direction, back);
        state.start_t = state.start_t + (state.t + (state.last + back));
        local_ray_origins(state.origin, scene, world->local_rays);
        local_ray_directions(direction, scene, world->local_rays);
        state.found = v_andnot(off, state.found);
        state.done = v_andnot(off, state.done);
        state.done = v_or(state.done, v_cmp_ge(state.evals, max_evals));
        int least = min_evals(state.evals, off); // a float: it does not count beyond 2^24
        state.steps = least > state.steps ? least : state.steps + 1;
    }
    *hit = (struct hit){
        .found = state.found, .shape = v_splat(-1.0f), .evals = v_min(state.evals, max_evals)};
    if (v_any(state.found))
        finish_hit(&state, near, deep, inside, direction, world, hit);
}

// Returns the light that reaches the point, 0 ... 1, with a penumbra. S. Aaltonen's estimator (GDC
// 2018): I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/rmshadows). The march
// passes the light and ends at the bounds, as in the paper. A ray that hits is not set to 0: its steps
// shrink towards the surface, and so do the terms. With longer steps a hit would have to be set to 0.
__attribute__((always_inline)) static inline vfloat
soft_shadow(vmask active, struct exit exit, bool groups, const struct world *world) {
    COUNT(soft_shadow, call);
    const struct prepared *scene = world->scene;
    const struct model *model = &scene->model;
    vmask done = v_not(active);
    vfloat hit_distance = v_splat((float)model->march.hit_distance);
    vfloat strength = v_splat((float)model->shadow_strength), zero = v_splat(0.0f);
    vfloat visibility = v_splat(1.0f), previous = v_splat(1e20f),
           t = v_splat((float)model->march.surface_offset);
    for (int step = 0; step < model->march.max_steps; step++) {
        ACTIVE(LANES - v_count(done));
        COUNT(soft_shadow, eval);
        vfloat h = sdf(world->local_rays, t, scene, done, groups, NULL);
        done = v_or(done, is_hit(h, t, hit_distance));
        if (v_all(done))
            break;
        ACTIVE(LANES - v_count(done));
        COUNT(soft_shadow, step);
        vfloat h_sq = h * h, y = h_sq / (v_splat(2.0f) * previous);
        vfloat d_sq = v_nmadd(y, y, h_sq), t_closest = t - y;
        // A ray that moves straight away from a surface (h = 2·previous) gives 0/0: no information.
        // In float the term is noise where d_sq/h² is of the order of the error of h, 1e-5 or more.
        vmask valid = v_and(v_cmp_gt(d_sq, h_sq * v_splat(2e-5f)), v_cmp_gt(t_closest, zero));
        // strength·√d_sq/t_closest < visibility, tested without the root, because it is seldom true.
        vfloat bound = visibility * t_closest;
        vmask darker =
            v_andnot(done, v_and(valid, v_cmp_lt(strength * strength * d_sq, bound * bound)));
        if (v_any(darker)) {
            ACTIVE(v_count(darker));
            COUNT(soft_shadow, darker);
            visibility = v_select(darker, strength * v_sqrt(d_sq) / t_closest, visibility);
        }
        previous = h;
        t = t + v_zero_where(done, h);
        done = v_or(done, outside(exit, t));
    }
    return visibility;
}

// Returns the ideal soft shadow, 0 ... 1: the least strength·h(t)/t up to the light. It is slow.
// The distance h falls no faster than t grows. So no ratio h/t is below `goal` within the next
// (h − goal·t)/(1 + goal). The goal is so little below the least ratio found that the result is at
// most ROOM too light. At a smooth minimum the steps are about ROOM·t, so the error is about ROOM².
// A Mandelbulb's h is an estimate: nothing is proved there.
#define ROOM (1.0f / 64)
#define LEAST_STEP 0x1p-16f // of t, for strengths that ask for less
__attribute__((always_inline)) static inline vfloat
ideal_shadow(vfloat distance, vmask active, bool groups, const struct world *world) {
    COUNT(ideal_shadow, call);
    COUNT(ideal_shadow, scalar);
    const struct prepared *scene = world->scene;
    float strength = (float)scene->model.shadow_strength, lit = 1.0f / strength;
    vfloat zero = v_splat(0.0f), one = v_splat(1.0f), least = v_splat(lit);
    vfloat room = v_splat(ROOM * (lit < 1.0f ? lit : 1.0f));
    vfloat t = v_splat((float)scene->model.march.surface_offset);
    vmask done = v_or(v_not(active), v_not(v_cmp_lt(t, distance)));
    while (!v_all(done)) {
        ACTIVE(LANES - v_count(done));
        COUNT(ideal_shadow, step);
        vfloat h = sdf(world->local_rays, t, scene, done, groups, NULL);
        least = v_select(done, least, v_min(least, v_max(h / t, zero)));
        vmask going = v_and(v_cmp_gt(least, zero), v_cmp_lt(t, distance));
        done = v_or(done, v_not(going));
        vfloat goal = least - room;
        vfloat step = v_max(v_nmadd(goal, t, h) / (one + goal), v_splat(LEAST_STEP) * t);
        t = v_select(done, t, v_min(t + step, distance));
    }
    return v_min(v_splat(strength) * least, one);
}

// Returns 1 where nothing blocks the ray before `distance`, else 0.
__attribute__((always_inline)) static inline vfloat hard_shadow(vfloat distance, vmask active,
                                                                struct exit exit, bool groups,
                                                                const struct world *world) {
    COUNT(hard_shadow, call);
    const struct prepared *scene = world->scene;
    vmask done = v_not(active);
    vfloat hit_distance = v_splat((float)scene->model.march.hit_distance);
    vfloat lit = v_splat(1.0f), t = v_splat((float)scene->model.march.surface_offset);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        ACTIVE(LANES - v_count(done));
        COUNT(hard_shadow, test);
        done = v_or(done, v_not(v_cmp_lt(t, distance)));
        if (v_all(done))
            break;
        ACTIVE(LANES - v_count(done));
        COUNT(hard_shadow, step);
        vfloat h = sdf(world->local_rays, t, scene, done, groups, NULL);
        vmask blocked = v_andnot(done, is_hit(h, t, hit_distance));
        lit = v_zero_where(blocked, lit);
        done = v_or(done, blocked);
        t = t + v_zero_where(done, h);
        done = v_or(done, outside(exit, t));
    }
    return lit;
}

__attribute__((always_inline)) static inline vfloat any_shadow(vfloat distance, vmask active,
                                                               struct exit exit, bool groups,
                                                               const struct world *world) {
    if (world->scene->model.shadows == SHADOWS_IDEAL)
        return ideal_shadow(distance, active, groups, world);
    return world->scene->model.shadows == SHADOWS_SOFT
               ? soft_shadow(active, exit, groups, world)
               : hard_shadow(distance, active, exit, groups, world);
}

vfloat shadow(struct point point, struct vec to_light, vfloat distance, vmask active,
              const struct world *world) {
    COUNT(shadow, call);
    const struct prepared *scene = world->scene;
    if (scene->model.shadows == SHADOWS_NONE)
        return v_splat(1.0f);
    local_ray_directions(to_light, scene, world->local_rays);
    struct exit exit = leaving(point, to_light, &scene->model);
    return scene->model.features.groups ? any_shadow(distance, active, exit, true, world)
                                        : any_shadow(distance, active, exit, false, world);
}
