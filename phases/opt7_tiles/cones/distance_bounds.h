// What cones and bundles take a shape's distance for: what float makes of it is taken off before it is believed.
#ifndef BOUNDS_H
#define BOUNDS_H

#include "cones/tile_cones.h"

// From a place on the way to the nearest from where the shape's own distance may say "hit".
__attribute__((always_inline)) static inline vfloat lower_bound(const struct local_ray *a, vfloat t,
                                                                const struct primitive *placed) {
    COUNT(lower_bound, call);
    vfloat d;
    if (placed->trust == BOUND_BALL) {
        COUNT(lower_bound, ball);
        struct vec p = vec_along(a->origin, a->direction, t);
        d = vec_norm(placed->repeated ? vec_wrapped(placed, p) : p) - v_splat(placed->a);
    } else
        d = distance_to_shape(a, t, placed, placed->repeated, placed->way, placed->type,
                              v_mask_all());
    return v_nmadd(v_abs(d), v_splat(0x1p-18f), d - v_splat(placed->error));
}

// What the distance itself is not above: by as much as was taken off it.
static inline vfloat upper_bound(vfloat lower, const struct primitive *placed) {
    COUNT(upper_bound, call);
    return v_madd(v_abs(lower), v_splat(0x1p-16f),
                  v_madd(v_splat(placed->error), v_splat(2.0f), lower));
}

static inline float near_distance(const struct limits *limits) {
    return (float)(limits->hit_distance + 4.0 * limits->normal_step);
}

static inline struct packet_rays eye_rays(struct march_scratch *own, const struct prepared *scene) {
    return (struct packet_rays){own->eye, scene->all, own->eye_wake, 1, v_splat(0.0f)};
}

// Of the shapes of the scene the wanted ones, in both orders, written to `shapes`.
struct shape_list list_wanted(const bool *wanted, const struct prepared *scene, int *shapes);
// The same for rays that are to be hit: all shapes where a Mandelbulb is wanted. Its estimate is no bound, a march leaps
// over what is thin, and what it finds hangs on every step from the ray's origin on.
struct shape_list list_wanted_hits(const bool *wanted, const struct prepared *scene, int *shapes);

#endif
