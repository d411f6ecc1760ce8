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

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds.
static double soft_shadow(const struct vec3 *point, const struct vec3 *to_light,
                          const struct prepared *scene) {
    COUNT(soft_shadow, call);
    int nearest;
    double least = 1.0, previous = 1e20, t = scene->model.march.surface_offset;
    struct vec3 p;
    vec_along(point, to_light, t, &p);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        COUNT(soft_shadow, step);
        double h = sdf(&p, scene, &nearest);
        if (h < scene->model.march.hit_distance)
            break;
        COUNT(soft_shadow, on);
        double y = h * h / (2.0 * previous);
        // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
        if (h * h - y * y > 0.0 && (COUNT(soft_shadow, inside), t - y > 0.0)) {
            COUNT(soft_shadow, term);
            least =
                fmin(least, scene->model.shadow_strength * sqrt(h * h - y * y) / fmax(0.0, t - y));
        }
        previous = h;
        t += h;
        vec_along(point, to_light, t, &p);
        if (vec_norm(&p) > scene->model.march.bounds_radius)
            break;
    }
    return fmin(fmax(least, 0.0), 1.0);
}

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

// 1: the light reaches the point, 0: it does not; between, the penumbra of a soft shadow.
double shadow(const struct vec3 *point, const struct vec3 *to_light, double distance,
              const struct prepared *scene) {
    switch (scene->model.shadows) {
    case SHADOWS_SOFT: return soft_shadow(point, to_light, scene);
    case SHADOWS_HARD: return hard_shadow(point, to_light, distance, scene);
    default: return 1.0;
    }
}
