// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996).
#include "trace.h"

double scene_distance(const double *p, const struct prepared *scene, int *nearest) {
    return sdf(p, scene, nearest);
}

void ray_march(const double *origin, const double *direction, const struct prepared *scene,
               struct hit *hit) {
    *hit = (struct hit){.shape = -1};
    vec_set(origin, hit->point);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        double distance = scene_distance(hit->point, scene, &hit->shape);
        hit->evals++;
        hit->last_t = hit->t;
        hit->last_distance = distance;
        hit->t += distance;
        vec_along(origin, direction, hit->t, hit->point);
        if (distance < scene->model.march.hit_distance) {
            hit->found = true;
            return;
        }
        if (vec_norm_sq(hit->point) > scene->bounds_sq)
            break;
    }
    hit->shape = -1;
}

// Returns the visibility of the light, 0 to 1. Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. The march goes past the light to the bounds.
static double soft_shadow(const double *point, const double *to_light,
                          const struct prepared *scene) {
    int nearest;
    double strength_sq = scene->model.shadow_strength * scene->model.shadow_strength;
    double visibility = 1.0, previous = 1e20, t = scene->model.march.surface_offset;
    double p[3];
    vec_along(point, to_light, t, p);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        double h = scene_distance(p, scene, &nearest);
        if (h < scene->model.march.hit_distance)
            break;
        double y = h * h / (2.0 * previous), d_sq = h * h - y * y;
        // Straight away from a surface h = 2·previous, and the term is 0/0: it is left out.
        // strength·√d_sq/(t − y) < visibility is seldom true, so it is tested without the root.
        double bound = visibility * (t - y);
        if (d_sq > 0.0 && t - y > 0.0 && strength_sq * d_sq < bound * bound) {
            visibility = scene->model.shadow_strength * sqrt(d_sq) / (t - y);
        }
        previous = h;
        t += h;
        vec_along(point, to_light, t, p);
        if (vec_norm_sq(p) > scene->bounds_sq)
            break;
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
static double ideal_shadow(const double *point, const double *to_light, double distance,
                           const struct prepared *scene) {
    int nearest;
    double strength = scene->model.shadow_strength, lit = 1.0 / strength, least = lit;
    double room = ROOM * min_of(lit, 1.0), t = scene->model.march.surface_offset;
    if (!(t < distance))
        return 1.0;
    for (;;) {
        double p[3];
        vec_along(point, to_light, t, p);
        double h = scene_distance(p, scene, &nearest);
        least = min_of(least, max_of(h / t, 0.0));
        if (!(least > 0.0 && t < distance))
            break;
        double goal = least - room;
        double step = max_of((h - goal * t) / (1.0 + goal), LEAST_STEP * t);
        t = min_of(t + step, distance);
    }
    return min_of(strength * least, 1.0);
}

// Returns 0 if the march meets a surface before the light, else 1.
static double hard_shadow(const double *point, const double *to_light, double distance,
                          const struct prepared *scene) {
    int nearest;
    double t = scene->model.march.surface_offset;
    double p[3];
    vec_along(point, to_light, t, p);
    for (int step = 0; step < scene->model.march.max_steps && t < distance; step++) {
        double h = scene_distance(p, scene, &nearest);
        if (h < scene->model.march.hit_distance)
            return 0.0;
        t += h;
        vec_along(point, to_light, t, p);
        if (vec_norm_sq(p) > scene->bounds_sq)
            break;
    }
    return 1.0;
}

double shadow(const double *point, const double *to_light, double distance,
              const struct prepared *scene) {
    switch (scene->model.shadows) {
    case SHADOWS_SOFT: return soft_shadow(point, to_light, scene);
    case SHADOWS_IDEAL: return ideal_shadow(point, to_light, distance, scene);
    case SHADOWS_HARD: return hard_shadow(point, to_light, distance, scene);
    default: return 1.0;
    }
}
