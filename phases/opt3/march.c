// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). A packet marches until its last ray is done.
#include "trace.h"

// Always inlined, as the shadows' marches are: in scenes without groups a call would cost them registers.
__attribute__((always_inline)) static inline void march(struct vec origin, struct vec direction,
                                                        vmask active, bool groups,
                                                        const struct prepared *scene,
                                                        struct hit *hit) {
    COUNT(ray_march, call);
    vmask done = v_not(active);
    vdouble hit_distance = v_splat(scene->model.march.hit_distance),
            bounds_sq = v_splat(scene->bounds_sq);
    vmask found = v_mask_none();
    vdouble t = v_splat(0.0), shape = v_splat(-1.0), evals = v_splat(0.0);
    struct vec point = origin;
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        vdouble nearest = v_splat(-1.0);
        ACTIVE(LANES - v_count(done));
        COUNT(ray_march, step);
        vdouble distance = sdf(point, scene, done, groups, &nearest);
        evals = evals + v_zero_where(done, v_splat(1.0));
        t = t + v_zero_where(done, distance);
        point = vec_along(origin, direction, t);
        vmask reached = v_andnot(done, v_cmp_lt(distance, hit_distance));
        vmask outside = v_andnot(done, v_cmp_gt(vec_dot(point, point), bounds_sq));
        vmask ended = v_or(reached, outside);
        if (v_any(ended)) {
            found = v_or(found, reached);
            shape = v_select(reached, nearest, shape);
            done = v_or(done, ended);
            if (v_all(done))
                break;
        }
    }
    *hit = (struct hit){found, t, point, shape, evals};
}

void ray_march(struct vec origin, struct vec direction, vmask active, const struct prepared *scene,
               struct hit *hit) {
    if (scene->model.features.groups)
        march(origin, direction, active, true, scene, hit);
    else
        march(origin, direction, active, false, scene, hit);
}

// Returns the light that reaches the point, 0 ... 1, with a penumbra. S. Aaltonen's estimator (GDC
// 2018): I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/rmshadows). The march
// passes the light and ends at the bounds, as in the paper.
__attribute__((always_inline)) static inline vdouble soft_shadow(struct vec point,
                                                                 struct vec to_light, vmask active,
                                                                 bool groups,
                                                                 const struct prepared *scene) {
    COUNT(soft_shadow, call);
    vmask done = v_not(active);
    vdouble hit_distance = v_splat(scene->model.march.hit_distance),
            bounds_sq = v_splat(scene->bounds_sq);
    vdouble strength = v_splat(scene->model.shadow_strength), zero = v_splat(0.0), nearest = zero;
    vdouble visibility = v_splat(1.0), previous = v_splat(1e20),
            t = v_splat(scene->model.march.surface_offset);
    struct vec p = vec_along(point, to_light, t);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        ACTIVE(LANES - v_count(done));
        COUNT(soft_shadow, eval);
        vdouble h = sdf(p, scene, done, groups, &nearest);
        done = v_or(done, v_cmp_lt(h, hit_distance));
        if (v_all(done))
            break;
        ACTIVE(LANES - v_count(done));
        COUNT(soft_shadow, step);
        vdouble y = h * h / (v_splat(2.0) * previous), d_sq = v_msub(h, h, y * y),
                t_closest = t - y;
        // A ray that moves straight away from a surface (h = 2·previous) gives 0/0: no information.
        vmask valid = v_andnot(done, v_and(v_cmp_gt(d_sq, zero), v_cmp_gt(t_closest, zero)));
        // strength·√d_sq/t_closest < visibility, tested without the root, because it is seldom true.
        vdouble bound = visibility * t_closest;
        vmask darker = v_and(valid, v_cmp_lt(strength * strength * d_sq, bound * bound));
        if (v_any(darker)) {
            ACTIVE(v_count(darker));
            COUNT(soft_shadow, darker);
            visibility = v_select(darker, strength * v_sqrt(d_sq) / t_closest, visibility);
        }
        previous = h;
        t = t + v_zero_where(done, h);
        p = vec_along(point, to_light, t);
        done = v_or(done, v_cmp_gt(vec_dot(p, p), bounds_sq));
    }
    return visibility;
}

// Returns the ideal soft shadow, 0 ... 1: the least strength·h(t)/t up to the light. It is slow.
// The distance h falls no faster than t grows. So no ratio h/t is below `goal` within the next
// (h − goal·t)/(1 + goal). The goal is so little below the least ratio found that the result is at
// most ROOM too light. At a smooth minimum the steps are about ROOM·t, so the error is about ROOM².
// A Mandelbulb's h is an estimate: nothing is proved there.
#define ROOM (1.0 / 64)
#define LEAST_STEP 0x1p-16 // of t, for strengths that ask for less
__attribute__((always_inline)) static inline vdouble
ideal_shadow(struct vec point, struct vec to_light, vdouble distance, vmask active, bool groups,
             const struct prepared *scene) {
    COUNT(ideal_shadow, call);
    COUNT(ideal_shadow, scalar);
    double strength = scene->model.shadow_strength, lit = 1.0 / strength;
    vdouble zero = v_splat(0.0), one = v_splat(1.0), least = v_splat(lit);
    vdouble room = v_splat(ROOM * (lit < 1.0 ? lit : 1.0));
    vdouble t = v_splat(scene->model.march.surface_offset), nearest = zero;
    vmask done = v_or(v_not(active), v_not(v_cmp_lt(t, distance)));
    while (!v_all(done)) {
        ACTIVE(LANES - v_count(done));
        COUNT(ideal_shadow, step);
        vdouble h = sdf(vec_along(point, to_light, t), scene, done, groups, &nearest);
        least = v_select(done, least, v_min(least, v_max(h / t, zero)));
        vmask going = v_and(v_cmp_gt(least, zero), v_cmp_lt(t, distance));
        done = v_or(done, v_not(going));
        vdouble goal = least - room;
        vdouble step = v_max(v_nmadd(goal, t, h) / (one + goal), v_splat(LEAST_STEP) * t);
        t = v_select(done, t, v_min(t + step, distance));
    }
    return v_min(v_splat(strength) * least, one);
}

// Returns 1 where nothing blocks the ray before `distance`, else 0.
__attribute__((always_inline)) static inline vdouble
hard_shadow(struct vec point, struct vec to_light, vdouble distance, vmask active, bool groups,
            const struct prepared *scene) {
    COUNT(hard_shadow, call);
    vmask done = v_not(active);
    vdouble hit_distance = v_splat(scene->model.march.hit_distance),
            bounds_sq = v_splat(scene->bounds_sq);
    vdouble lit = v_splat(1.0), nearest = lit, t = v_splat(scene->model.march.surface_offset);
    struct vec p = vec_along(point, to_light, t);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        ACTIVE(LANES - v_count(done));
        COUNT(hard_shadow, test);
        done = v_or(done, v_not(v_cmp_lt(t, distance)));
        if (v_all(done))
            break;
        ACTIVE(LANES - v_count(done));
        COUNT(hard_shadow, step);
        vdouble h = sdf(p, scene, done, groups, &nearest);
        vmask blocked = v_andnot(done, v_cmp_lt(h, hit_distance));
        lit = v_zero_where(blocked, lit);
        done = v_or(done, blocked);
        t = t + v_zero_where(done, h);
        p = vec_along(point, to_light, t);
        done = v_or(done, v_cmp_gt(vec_dot(p, p), bounds_sq));
    }
    return lit;
}

__attribute__((always_inline)) static inline vdouble
any_shadow(struct vec point, struct vec to_light, vdouble distance, vmask active, bool groups,
           const struct prepared *scene) {
    switch (scene->model.shadows) {
    case SHADOWS_SOFT: return soft_shadow(point, to_light, active, groups, scene);
    case SHADOWS_IDEAL: return ideal_shadow(point, to_light, distance, active, groups, scene);
    case SHADOWS_HARD: return hard_shadow(point, to_light, distance, active, groups, scene);
    default: return v_splat(1.0);
    }
}

vdouble shadow(struct vec point, struct vec to_light, vdouble distance, vmask active,
               const struct prepared *scene) {
    COUNT(shadow, call);
    return scene->model.features.groups
               ? any_shadow(point, to_light, distance, active, true, scene)
               : any_shadow(point, to_light, distance, active, false, scene);
}
