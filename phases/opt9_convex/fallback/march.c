// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). A packet of rays marches until the last is done.
#include "fallback/trace.h"
#include "simd/simd.h"
#include "types/ideal.h"

#include <limits.h>

// A ray leaves the bounds when |o + t·d|² > radius². That is a polynomial in t, and float knows it to a few
// 2^-24 of radius². So a ray marches on until 2^-20 past the bounds, and within() checks its hit.
struct bounds_exit {
    vfloat linear, constant; // t·(t + linear) + constant > 0
};

static struct bounds_exit bounds_exit_of(struct point origin, struct vec direction,
                                         const struct model *model) {
    float radius = (float)model->march.bounds_radius;
    struct vec o = origin.hi;
    return (struct bounds_exit){v_splat(2.0f) * vec_dot(o, direction),
                                vec_dot(o, o) - v_splat(radius * radius * (1.0f + 0x1p-20f))};
}

// Returns which points are within the bounds, in doubles.
static vmask within(struct point place, const struct model *model) {
    double radius = model->march.bounds_radius;
    return v_cmp_ge(v_splat(0.0f), power_at(vec_double_of(place), radius * radius));
}

static inline vmask outside(struct bounds_exit exit, vfloat t) {
    return v_cmp_gt(v_madd(t, t + exit.linear, exit.constant), v_splat(0.0f));
}

// The hit test in float: the hit distance, or 2^-24·t if that is more. Below half an ulp of t, which is at most
// 2^-24·t, a step does not move the ray, and it would stall there until the step cap.
static inline vmask reaches(vfloat distance, vfloat t, vfloat hit_distance) {
    return v_cmp_lt(distance, v_max(hit_distance, t * v_splat(0x1p-24f)));
}

// Returns Newton's last step to the surface: a grazing ray has up to 33 times h to go. Only for an h that
// rounding may leave: what a larger hit_distance leaves is the scene's choice.
static inline vfloat newton(vfloat h, vfloat slope, vfloat marched) {
    vmask rounding = v_cmp_lt(v_abs(h), marched * v_splat(0x1p-21f));
    return v_select_or_zero(rounding, h / v_max(slope, v_splat(0x1p-9f)));
}

// The rays are at the distance before + t + last. t and the last step stay apart: their rounded sum would lose
// the digits that place the hit on the surface.
struct march_state {
    struct point origin; // at the distance `before`
    vfloat before, t, last, evals;
    vmask done, found;
    int steps; // of the ray that has taken the fewest, among the rays that march on
};

// Marches until every ray has ended. The hit test is that of a march in float, whose error grows with t.
static inline void march(struct march_state *at, struct vec direction,
                         const struct trace_context *world) {
    const struct prepared *scene = world->scene;
    struct bounds_exit exit = bounds_exit_of(at->origin, direction, &scene->model);
    vfloat hit_distance = v_splat((float)scene->model.march.hit_distance);
    vmask done = at->done, found = at->found;
    vfloat t = v_splat(0.0f), last = t, evals = at->evals;
    for (int step = at->steps; step < scene->model.march.max_steps; step++) {
        ACTIVE(LANES - v_count(done));
        COUNT(march_step, call);
        vfloat distance = sdf(world->local_rays, t, scene, done, NULL);
        evals = evals + v_zero_where(done, v_splat(1.0f));
        vmask reached = v_andnot(done, reaches(distance, t, hit_distance));
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
    *at = (struct march_state){at->origin, at->before, t, last, evals, done, found, at->steps};
}

// Sets the shape in which a ray of `deep` was when its march ended. The step back may bring it nearer to
// another shape.
__attribute__((noinline)) static void
shape_inside(vmask deep, vfloat t, const struct trace_context *world, vfloat *shape) {
    vfloat inside = v_splat(-1.0f);
    sdf(world->local_rays, t, world->scene, v_not(deep), &inside);
    *shape = v_select(deep, inside, *shape);
}

// Returns the fewest evaluations that a ray of `on` has taken. The step cap holds for each ray by itself.
static int fewest(vfloat evals, vmask on) {
    float had[LANES];
    int least = INT_MAX;
    v_store(evals, had);
    for (unsigned rest = v_mask_bits(on); rest; rest &= rest - 1) {
        int evaluations = (int)had[__builtin_ctz(rest)];
        least = evaluations < least ? evaluations : least;
    }
    return least;
}

// Completes hits at the end of a march: normal, shape and exact distance. deep: rays that started in a shape,
// `inside`. Precondition: the hits are the origins of world->local_rays, and `near` their surroundings.
__attribute__((always_inline)) static inline void
finish_hits(const struct march_state *at, struct vec direction, vmask deep, vfloat inside,
            struct hit_surroundings near, const struct trace_context *world, struct hit *hit) {
    const struct prepared *scene = world->scene;
    vfloat marched = at->before + at->t;
    vmask unmoved = v_cmp_ge(v_splat(0.0f), marched); // rays that hit where they start
    hit->found = v_and(hit->found, v_or(within(at->origin, &scene->model), unmoved));
    if (v_any(deep)) {
        near.contact =
            v_or(near.contact, v_and(deep, v_cmp_ge(v_abs(near.shape - inside), v_splat(0.5f))));
        near.shape = v_select(deep, inside, near.shape);
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

// Each hit becomes an origin in the frames of all shapes, where the distance is rounded at a shape's size. A
// hit further than twice the hit distance from its shape marches on from there.
void ray_march(struct point origin, struct vec direction, vmask active,
               const struct trace_context *world, struct hit *hit) {
    const struct prepared *scene = world->scene;
    float twice = 2.0f * (float)scene->model.march.hit_distance;
    vfloat zero = v_splat(0.0f), off_from = v_splat(twice), sunk_from = v_splat(-twice);
    vfloat most = v_splat((float)scene->model.march.max_steps);
    struct march_state at = {
        .origin = origin, .before = zero, .evals = zero, .found = v_mask_none()};
    at.done = v_not(active);
    vmask deep = v_mask_none(); // a ray that started inside a shape has stepped back out of it
    vfloat inside = v_splat(-1.0f);
    struct hit_surroundings near = {zero, inside, v_mask_none()};
    set_local_origins(origin, scene, world->local_rays);
    set_local_directions(direction, scene, world->local_rays);
    for (;;) {
        vmask settled = at.found;
        march(&at, direction, world);
        if (!v_any(at.found))
            break;
        // march() counts from the ray with the fewest steps: others may have taken more than the cap.
        at.found = v_andnot(v_cmp_gt(at.evals, most), at.found);
        vmask sunk = v_and(at.found, v_cmp_lt(at.last, sunk_from));
        if (v_any(sunk))
            shape_inside(sunk, at.t, world, &inside);
        deep = v_or(deep, sunk);
        at.origin = point_at(at.origin, direction, at.t, at.last);
        set_local_origins(at.origin, scene, world->local_rays);
        near = near_hit(at.found, world);
        vmask off =
            v_and(at.found, v_andnot(v_or(deep, settled), v_cmp_gt(near.distance, off_from)));
        if (!v_any(off))
            break;
        // The ray starts far enough back to be in front of the surface, even of a shape as thin as an ulp of t.
        vfloat back = v_select_or_zero(off, at.t * v_splat(-0x1p-22f));
        at.origin.lo = vec_along(at.origin.lo, direction, back);
        at.before = at.before + (at.t + (at.last + back));
        set_local_origins(at.origin, scene, world->local_rays);
        set_local_directions(direction, scene, world->local_rays);
        at.found = v_andnot(off, at.found);
        at.done = v_andnot(off, at.done);
        at.done = v_or(at.done, v_cmp_ge(at.evals, most));
        int had = fewest(at.evals, off); // a float, which cannot count past 2^24
        at.steps = had > at.steps ? had : at.steps + 1;
    }
    *hit = (struct hit){.found = at.found, .shape = v_splat(-1.0f), .evals = v_min(at.evals, most)};
    if (!v_any(at.found))
        return;
    finish_hits(&at, direction, deep, inside, near, world, hit);
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds.
static vfloat soft_shadow(vmask active, struct bounds_exit exit,
                          const struct trace_context *world) {
    const struct prepared *scene = world->scene;
    const struct model *model = &scene->model;
    vmask done = v_not(active);
    vfloat hit_distance = v_splat((float)model->march.hit_distance);
    vfloat strength = v_splat((float)model->shadow_strength), zero = v_splat(0.0f);
    vfloat least = v_splat(1.0f), previous = v_splat(1e20f),
           t = v_splat((float)model->march.surface_offset);
    for (int step = 0; step < model->march.max_steps; step++) {
        vfloat h = sdf(world->local_rays, t, scene, done, NULL);
        done = v_or(done, reaches(h, t, hit_distance));
        if (v_all(done))
            break;
        vfloat square = h * h, y = square / (v_splat(2.0f) * previous);
        vfloat inside = v_nmadd(y, y, square), beyond = t - y;
        // The term is 0/0 on a ray straight away from a surface (h = 2·previous), and is left out.
        // In float it is noise wherever inside/h² is of the order of h's rounding error, 1e-5 at least.
        vmask sound = v_and(v_cmp_gt(inside, square * v_splat(2e-5f)), v_cmp_gt(beyond, zero));
        // Tests strength·√inside/beyond < least without the root, as it is seldom true.
        vfloat scaled = least * beyond;
        vmask darker =
            v_andnot(done, v_and(sound, v_cmp_lt(strength * strength * inside, scaled * scaled)));
        if (v_any(darker))
            least = v_select(darker, strength * v_sqrt(inside) / beyond, least);
        previous = h;
        t = t + v_zero_where(done, h);
        done = v_or(done, outside(exit, t));
    }
    return least;
}

// Returns the ideal soft shadow, 0 ... 1: the least strength·h(t)/t up to the light. As h falls no faster
// than t grows, no ratio is below `goal` within (h − goal·t)/(1 + goal). goal: so little below the least
// ratio found that the result is at most ROOM too light (about ROOM² at a smooth minimum). Nothing is proved
// of a fractal. A Mandelbox's rays pass near it all the way, and get larger steps.
#define ROOM (1.0f / 64)
#define BOX_ROOM (1.0f / 4)
#define LEAST_STEP 0x1p-16f // of t, for strengths that ask for less
static vfloat ideal_shadow(vfloat distance, vmask active, const struct trace_context *world) {
    const struct prepared *scene = world->scene;
    float strength = (float)scene->model.shadow_strength, lit = 1.0f / strength;
    vfloat zero = v_splat(0.0f), one = v_splat(1.0f), least = v_splat(lit);
    float share = scene->model.features.count[SHAPE_MANDELBOX] ? BOX_ROOM : ROOM;
    vfloat room = v_splat(share * (lit < 1.0f ? lit : 1.0f));
    vfloat t = v_splat((float)scene->model.march.surface_offset);
    vmask done = v_or(v_not(active), v_not(v_cmp_lt(t, distance)));
    while (!v_all(done)) {
        vfloat h = sdf(world->local_rays, t, scene, done, NULL);
        least = v_select(done, least, v_min(least, v_max(h / t, zero)));
        vmask going = v_and(v_cmp_gt(least, zero), v_cmp_lt(t, distance));
        done = v_or(done, v_not(going));
        vfloat goal = least - room;
        vfloat step = v_max(v_nmadd(goal, t, h) / (one + goal), v_splat(LEAST_STEP) * t);
        t = v_select(done, t, v_min(t + step, distance));
    }
    return v_min(v_splat(strength) * least, one);
}

static vfloat hard_shadow(vfloat distance, vmask active, struct bounds_exit exit,
                          const struct trace_context *world) {
    const struct prepared *scene = world->scene;
    vmask done = v_not(active);
    vfloat hit_distance = v_splat((float)scene->model.march.hit_distance);
    vfloat lit = v_splat(1.0f), t = v_splat((float)scene->model.march.surface_offset);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        done = v_or(done, v_not(v_cmp_lt(t, distance)));
        if (v_all(done))
            break;
        vfloat h = sdf(world->local_rays, t, scene, done, NULL);
        vmask blocked = v_andnot(done, reaches(h, t, hit_distance));
        lit = v_zero_where(blocked, lit);
        done = v_or(done, blocked);
        t = t + v_zero_where(done, h);
        done = v_or(done, outside(exit, t));
    }
    return lit;
}

// Returns 1 where the light reaches the point, 0 where it does not, and values between in the penumbra of a
// soft shadow.
vfloat shadow(struct point point, struct vec to_light, vfloat distance, vmask active,
              const struct trace_context *world) {
    const struct prepared *scene = world->scene;
    if (scene->model.shadows == SHADOWS_NONE)
        return v_splat(1.0f);
    set_local_directions(to_light, scene, world->local_rays);
    struct bounds_exit exit = bounds_exit_of(point, to_light, &scene->model);
    if (scene->model.shadows == SHADOWS_HARD)
        return hard_shadow(distance, active, exit, world);
    return SOFT_IS_IDEAL || scene->model.shadows == SHADOWS_IDEAL
               ? ideal_shadow(distance, active, world)
               : soft_shadow(active, exit, world);
}
