// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996).
#include "trace.h"

void ray_march(const struct vec3 *origin, const struct vec3 *direction,
               const struct prepared *scene, struct hit *hit) {
    COUNT(ray_march, call);
    *hit = (struct hit){.point = *origin, .shape = -1};
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        COUNT(ray_march, step);
        double distance = sdf(&hit->point, scene, &hit->shape);
        hit->evals++;
        hit->t += distance;
        vec_along(origin, direction, hit->t, &hit->point);
        if (distance < scene->model.march.hit_distance) {
            hit->found = true;
            return;
        }
        COUNT(ray_march, on);
        if (vec_norm(&hit->point) > scene->model.march.bounds_radius)
            break;
    }
    hit->shape = -1;
}

// Returns the light that reaches the point, 0 ... 1, with a penumbra. S. Aaltonen's estimator (GDC
// 2018): I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/rmshadows). The march
// passes the light and ends at the bounds, as in the paper.
static double soft_shadow(const struct vec3 *point, const struct vec3 *to_light,
                          const struct prepared *scene) {
    COUNT(soft_shadow, call);
    int nearest;
    double visibility = 1.0, previous = 1e20, t = scene->model.march.surface_offset;
    struct vec3 p;
    vec_along(point, to_light, t, &p);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        COUNT(soft_shadow, step);
        double h = sdf(&p, scene, &nearest);
        if (h < scene->model.march.hit_distance)
            break;
        COUNT(soft_shadow, on);
        double y = h * h / (2.0 * previous);
        // A ray that moves straight away from a surface (h = 2·previous) gives 0/0: no information.
        if (h * h - y * y > 0.0 && (COUNT(soft_shadow, inside), t - y > 0.0)) {
            COUNT(soft_shadow, term);
            visibility = fmin(visibility, scene->model.shadow_strength * sqrt(h * h - y * y) /
                                              fmax(0.0, t - y));
        }
        previous = h;
        t += h;
        vec_along(point, to_light, t, &p);
        if (vec_norm(&p) > scene->model.march.bounds_radius)
            break;
    }
    return fmin(fmax(visibility, 0.0), 1.0);
}

// Returns the ideal soft shadow, 0 ... 1: the least strength·h(t)/t up to the light. It is slow.
// The distance h falls no faster than t grows. So no ratio h/t is below `goal` within the next
// (h − goal·t)/(1 + goal). The goal is so little below the least ratio found that the result is at
// most ROOM too light. At a smooth minimum the steps are about ROOM·t, so the error is about ROOM².
// A Mandelbulb's h is an estimate: nothing is proved there.
#define ROOM (1.0 / 64)
#define LEAST_STEP 0x1p-16 // of t, for strengths that ask for less
static double ideal_shadow(const struct vec3 *point, const struct vec3 *to_light, double distance,
                           const struct prepared *scene) {
    COUNT(ideal_shadow, call);
    int nearest;
    double strength = scene->model.shadow_strength, lit = 1.0 / strength, least = lit;
    double room = ROOM * fmin(lit, 1.0), t = scene->model.march.surface_offset;
    if (!(t < distance))
        return 1.0;
    for (;;) {
        COUNT(ideal_shadow, step);
        struct vec3 p;
        vec_along(point, to_light, t, &p);
        double h = sdf(&p, scene, &nearest);
        least = fmin(least, fmax(h / t, 0.0));
        if (!(least > 0.0 && t < distance))
            break;
        COUNT(ideal_shadow, on);
        double goal = least - room;
        double step = fmax((h - goal * t) / (1.0 + goal), LEAST_STEP * t);
        t = fmin(t + step, distance);
    }
    return fmin(strength * least, 1.0);
}

// Returns 1 where nothing blocks the ray before `distance`, else 0.
static double hard_shadow(const struct vec3 *point, const struct vec3 *to_light, double distance,
                          const struct prepared *scene) {
    COUNT(hard_shadow, call);
    int nearest;
    double t = scene->model.march.surface_offset;
    struct vec3 p;
    vec_along(point, to_light, t, &p);
    for (int step = 0; step < scene->model.march.max_steps && t < distance; step++) {
        COUNT(hard_shadow, step);
        double h = sdf(&p, scene, &nearest);
        if (h < scene->model.march.hit_distance)
            return 0.0;
        COUNT(hard_shadow, on);
        t += h;
        vec_along(point, to_light, t, &p);
        if (vec_norm(&p) > scene->model.march.bounds_radius)
            break;
    }
    return 1.0;
}

double shadow(const struct vec3 *point, const struct vec3 *to_light, double distance,
              const struct prepared *scene) {
    switch (scene->model.shadows) {
    case SHADOWS_SOFT: return soft_shadow(point, to_light, scene);
    case SHADOWS_IDEAL: return ideal_shadow(point, to_light, distance, scene);
    case SHADOWS_HARD: return hard_shadow(point, to_light, distance, scene);
    default: return 1.0;
    }
}
