// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). TURNS packets march until the last ray is done.
#include "fallback/trace.h"
#include "march/march_step.h"
#include "simd/simd.h"
#include "types/ideal.h"

static inline vmask outside(struct bounds_exit exit, vfloat t) {
    return v_cmp_gt(outside_of_bounds(exit, t), v_splat(0.0f));
}

static inline vmask reaches(vfloat distance, vfloat t, vfloat hit_distance) {
    return v_cmp_lt(distance, min_step(t, hit_distance));
}

// The rays are at the distance before + t + last. t and the last step stay apart: their rounded sum would lose
// the digits that place the hit on the surface.
struct march_state {
    struct point origin; // at the distance `before`
    vfloat before, t, last, evals;
    vmask done, found;
    vmask deep;    // a ray that started inside a shape has stepped back out of it
    vfloat inside; // the shape that a ray of `deep` was in
    struct hit_surroundings near;
};

// Sets `turn` to the packets whose rays are not all done. Returns their number.
static inline int going(const vmask done[TURNS], int turn[TURNS]) {
    int count = 0;
    for (int k = 0; k < TURNS; k++)
        if (!v_all(done[k]))
            turn[count++] = k;
    return count;
}

// Sets h to the scene's distances at t along the rays of the packets of `turn`.
__attribute__((noinline)) static void distances(const struct trace_context world[TURNS],
                                                const vfloat t[TURNS], const vmask done[TURNS],
                                                const int *turn, int count, vfloat h[TURNS]) {
    const struct prepared *scene = world->scene;
    for (int k = 0; k < TURNS; k++)
        h[k] = v_splat(INFINITY);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *s = &scene->primitives[i];
        struct vec p[TURNS];
        vfloat to[TURNS];
        for (int j = 0; j < count; j++) {
            const struct local_ray *ray = &world[turn[j]].local_rays[i];
            if (s->type == SHAPE_MANDELBOX)
                p[j] = point_on(ray, t[turn[j]], s);
            else
                to[j] = distance_to_shape(ray, t[turn[j]], s, s->repeated, s->eval, s->type,
                                          v_not(done[turn[j]]));
        }
        if (s->type == SHAPE_MANDELBOX)
            sdf_mandelboxes(p, count, s, to);
        for (int j = 0; j < count; j++)
            h[turn[j]] = v_min(to[j], h[turn[j]]);
    }
}

// Marches until every ray has ended. The hit test is that of a march in float, whose error grows with t.
static void march(struct march_state at[TURNS], const struct ray_packets *rays,
                  const struct trace_context world[TURNS]) {
    const struct model *model = &world->scene->model;
    vfloat hit_distance = v_splat((float)model->march.hit_distance), t[TURNS], h[TURNS];
    vfloat most = v_splat((float)step_cap(model));
    struct bounds_exit exit[TURNS];
    vmask done[TURNS];
    for (int k = 0; k < TURNS; k++) {
        done[k] = at[k].done;
        t[k] = v_splat(0.0f);
        exit[k] = bounds_exit_of(at[k].origin, rays->direction[k], model);
        if (!v_all(done[k]))
            at[k].t = at[k].last = t[k];
    }
    int turn[TURNS], count;
    while ((count = going(done, turn)) > 0) {
        distances(world, t, done, turn, count, h);
        for (int j = 0; j < count; j++) {
            int k = turn[j];
            ACTIVE(LANES - v_count(done[k]));
            COUNT(march_step, call);
            at[k].evals = at[k].evals + v_zero_where(done[k], v_splat(1.0f));
            vmask reached = v_andnot(done[k], reaches(h[k], t[k], hit_distance));
            at[k].last = v_select(reached, h[k], at[k].last);
            at[k].found = v_or(at[k].found, reached);
            t[k] = at[k].t = t[k] + v_zero_where(v_or(done[k], reached), h[k]);
            vmask ended = v_or(reached, v_or(outside(exit[k], t[k]), v_cmp_ge(at[k].evals, most)));
            done[k] = at[k].done = v_or(done[k], ended);
        }
    }
}

// Completes hits at the end of a march: normal, shape and exact distance. Precondition: the hits are the origins of
// world->local_rays.
static void finish_hits(const struct march_state *at, struct vec direction,
                        const struct trace_context *world, struct hit *hit) {
    const struct prepared *scene = world->scene;
    vmask deep = at->deep;
    struct hit_surroundings near = at->near;
    vfloat marched = at->before + at->t;
    vmask unmoved = v_cmp_ge(v_splat(0.0f), marched); // rays that hit where they start
    hit->found = v_and(hit->found, v_or(within(at->origin, &scene->model), unmoved));
    if (v_any(deep)) {
        near.contact = v_or(near.contact,
                            v_and(deep, v_cmp_ge(v_abs(near.shape - at->inside), v_splat(0.5f))));
        near.shape = v_select(deep, at->inside, near.shape);
    }
    vfloat slope;
    hit->normal = normal_at(direction, hit->found, &near, world, &slope);
    hit->shape = v_select(hit->found, near.shape, hit->shape);
    vfloat more = v_zero_where(deep, newton(near.distance, slope, marched));
    hit->t = at->before + (at->t + (at->last + more));
    hit->point = at->origin;
    hit->point.lo = vec_along(hit->point.lo, direction, more);
    move_local_rays(more, scene, world->local_rays);
}

// Places the hits of a march in the frames of all shapes, where the distance is rounded at a shape's size. Returns
// whether rays march on: those whose hit is further than twice the hit distance from its shape. settled: hits of earlier
// marches.
static bool land(struct march_state *at, vmask settled, struct vec direction,
                 const struct trace_context *world) {
    const struct prepared *scene = world->scene;
    float twice = 2.0f * (float)scene->model.march.hit_distance;
    if (!v_any(at->found))
        return false;
    vmask sunk = v_and(at->found, v_cmp_lt(at->last, v_splat(-twice)));
    if (v_any(sunk)) { // the step back may bring it nearer to another shape
        vfloat inside = v_splat(-1.0f);
        sdf(world->local_rays, at->t, scene, v_not(sunk), &inside);
        at->inside = v_select(sunk, inside, at->inside);
    }
    at->deep = v_or(at->deep, sunk);
    at->origin = point_at(at->origin, direction, at->t, at->last);
    set_local_origins(at->origin, scene, world->local_rays);
    at->near = near_hit(at->found, world);
    vmask off = v_and(
        at->found, v_andnot(v_or(at->deep, settled), v_cmp_gt(at->near.distance, v_splat(twice))));
    if (!v_any(off))
        return false;
    // The ray starts far enough back to be in front of the surface, even of a shape as thin as an ulp of t.
    vfloat back = v_select_or_zero(off, at->t * v_splat(-0x1p-22f));
    at->origin.lo = vec_along(at->origin.lo, direction, back);
    at->before = at->before + (at->t + (at->last + back));
    set_local_origins(at->origin, scene, world->local_rays);
    set_local_directions(direction, scene, world->local_rays);
    at->found = v_andnot(off, at->found);
    at->done =
        v_or(v_andnot(off, at->done), v_cmp_ge(at->evals, v_splat((float)step_cap(&scene->model))));
    return true;
}

void ray_march(const struct ray_packets *rays, const struct trace_context world[TURNS],
               struct hit hit[TURNS]) {
    vfloat zero = v_splat(0.0f), none = v_splat(-1.0f);
    vmask nowhere = v_mask_none(), settled[TURNS], ended[TURNS];
    struct march_state at[TURNS];
    for (int k = 0; k < TURNS; k++) {
        ended[k] = v_not(rays->active[k]);
        at[k] =
            (struct march_state){rays->origin[k], zero,    zero,    zero, zero,
                                 ended[k],        nowhere, nowhere, none, {zero, none, nowhere}};
        set_local_origins(rays->origin[k], world->scene, world[k].local_rays);
        set_local_directions(rays->direction[k], world->scene, world[k].local_rays);
    }
    int turn[TURNS];
    while (going(ended, turn) > 0) {
        for (int k = 0; k < TURNS; k++)
            settled[k] = at[k].found;
        march(at, rays, world);
        for (int k = 0; k < TURNS; k++)
            if (!v_all(ended[k]) && !land(&at[k], settled[k], rays->direction[k], &world[k]))
                at[k].done = ended[k] = v_mask_all();
    }
    for (int k = 0; k < TURNS; k++) {
        hit[k] = (struct hit){.found = at[k].found, .shape = none, .evals = at[k].evals};
        if (v_any(at[k].found))
            finish_hits(&at[k], rays->direction[k], &world[k], &hit[k]);
    }
}

// Rays towards the light, at the distance t.
struct shadow_march {
    vfloat t, light, previous;
    vmask done;
    struct bounds_exit exit;
};

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds.
static void step_soft(struct shadow_march *at, vfloat h, const struct model *model) {
    vfloat strength = v_splat((float)model->shadow_strength), zero = v_splat(0.0f);
    at->done = v_or(at->done, reaches(h, at->t, v_splat((float)model->march.hit_distance)));
    vfloat square = h * h, y = square / (v_splat(2.0f) * at->previous);
    vfloat inside = v_nmadd(y, y, square), beyond = at->t - y;
    // The term is 0/0 on a ray straight away from a surface (h = 2·previous), and is left out.
    // In float it is noise wherever inside/h² is of the order of h's rounding error, 1e-5 at least.
    vmask sound = v_and(v_cmp_gt(inside, square * v_splat(2e-5f)), v_cmp_gt(beyond, zero));
    // Tests strength·√inside/beyond < least without the root, as it is seldom true.
    vfloat scaled = at->light * beyond;
    vmask darker =
        v_andnot(at->done, v_and(sound, v_cmp_lt(strength * strength * inside, scaled * scaled)));
    if (v_any(darker))
        at->light = v_select(darker, strength * v_sqrt(inside) / beyond, at->light);
    at->previous = h;
    at->t = at->t + v_zero_where(at->done, h);
    at->done = v_or(at->done, outside(at->exit, at->t));
}

// The ideal soft shadow: the least h(t)/t up to the light, from 1/strength. As h falls no faster
// than t grows, no ratio is below `goal` within (h − goal·t)/(1 + goal). goal: so little below the least
// ratio found that the result is at most ROOM too light (about ROOM² at a smooth minimum). Nothing is proved
// of a fractal. A Mandelbox's rays pass near it all the way, and get larger steps.
#define ROOM (1.0f / 64)
#define BOX_ROOM (1.0f / 4)
#define LEAST_STEP 0x1p-16f // of t, for strengths that ask for less
static void step_ideal(struct shadow_march *at, vfloat h, vfloat distance,
                       const struct model *model) {
    float lit = 1.0f / (float)model->shadow_strength;
    float share = model->features.count[SHAPE_MANDELBOX] ? BOX_ROOM : ROOM;
    vfloat room = v_splat(share * (lit < 1.0f ? lit : 1.0f)), zero = v_splat(0.0f), t = at->t;
    at->light = v_select(at->done, at->light, v_min(at->light, v_max(h / t, zero)));
    at->done = v_or(at->done, v_not(v_and(v_cmp_gt(at->light, zero), v_cmp_lt(t, distance))));
    vfloat goal = at->light - room;
    vfloat step = v_max(v_nmadd(goal, t, h) / (v_splat(1.0f) + goal), v_splat(LEAST_STEP) * t);
    at->t = v_select(at->done, t, v_min(t + step, distance));
}

static void step_hard(struct shadow_march *at, vfloat h, vfloat distance,
                      const struct model *model) {
    vfloat hit_distance = v_splat((float)model->march.hit_distance);
    vmask blocked = v_andnot(at->done, reaches(h, at->t, hit_distance));
    at->light = v_zero_where(blocked, at->light);
    at->done = v_or(at->done, blocked);
    at->t = at->t + v_zero_where(at->done, h);
    at->done = v_or(at->done, v_or(outside(at->exit, at->t), v_not(v_cmp_lt(at->t, distance))));
}

void shadow(const struct ray_packets *rays, const vfloat distance[TURNS],
            const struct trace_context world[TURNS], vfloat light[TURNS]) {
    const struct model *model = &world->scene->model;
    vfloat one = v_splat(1.0f), strength = v_splat((float)model->shadow_strength), t[TURNS],
           h[TURNS];
    for (int k = 0; k < TURNS; k++)
        light[k] = one;
    if (model->shadows == SHADOWS_NONE)
        return;
    bool hard = model->shadows == SHADOWS_HARD;
    bool ideal = !hard && (SOFT_IS_IDEAL || model->shadows == SHADOWS_IDEAL);
    struct shadow_march at[TURNS];
    vmask done[TURNS];
    for (int k = 0; k < TURNS; k++) {
        set_local_directions(rays->direction[k], world->scene, world[k].local_rays);
        t[k] = v_splat((float)model->march.surface_offset);
        done[k] = v_not(rays->active[k]);
        if (hard || ideal)
            done[k] = v_or(done[k], v_not(v_cmp_lt(t[k], distance[k])));
        at[k] = (struct shadow_march){
            t[k], v_splat(ideal ? 1.0f / (float)model->shadow_strength : 1.0f), v_splat(1e20f),
            done[k], bounds_exit_of(rays->origin[k], rays->direction[k], model)};
    }
    int turn[TURNS], count;
    for (int step = 0; (count = going(done, turn)) > 0 && (ideal || step < model->march.max_steps);
         step++) {
        distances(world, t, done, turn, count, h);
        for (int j = 0; j < count; j++) {
            int k = turn[j];
            if (hard)
                step_hard(&at[k], h[k], distance[k], model);
            else if (ideal)
                step_ideal(&at[k], h[k], distance[k], model);
            else
                step_soft(&at[k], h[k], model);
            t[k] = at[k].t;
            done[k] = at[k].done;
        }
    }
    for (int k = 0; k < TURNS; k++) {
        light[k] = at[k].light;
        if (ideal)
            light[k] = v_min(strength * light[k], one);
    }
}
