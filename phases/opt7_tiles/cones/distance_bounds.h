// What cones and bundles take a shape's distance for: what float makes of it is taken off before it is believed.
#ifndef BOUNDS_H
#define BOUNDS_H

#include "cones/march_scratch.h"
#include "core/packet_group.h"
#include "core/shape_distances.h"

// From afar the Mandelbulb's estimate is r·ln(r)/3, which is above its tangent at e²: r less this.
#define FAR_TANGENT 2.48f

// From a place on the way to the nearest from where the shape's own distance may say "hit".
__attribute__((always_inline)) static inline vfloat lower_bound(const struct local_ray *a, vfloat t,
                                                                const struct primitive *primitive) {
    COUNT(lower_bound, call);
    vfloat d;
    if (primitive->trust == BOUND_BALL) {
        COUNT(lower_bound, ball);
        struct vec p = vec_along(a->origin, a->direction, t);
        d = vec_norm(primitive->repeated ? vec_wrapped(primitive, p) : p) - v_splat(primitive->a);
    } else
        d = distance_to_shape(a, t, primitive, primitive->repeated, primitive->kind,
                              primitive->type, v_mask_all());
    return v_nmadd(v_abs(d), v_splat(0x1p-18f), d - v_splat(primitive->error));
}

// What the distance itself is not above: by as much as was taken off it.
static inline vfloat upper_bound(vfloat lower, const struct primitive *primitive) {
    COUNT(upper_bound, call);
    return v_madd(v_abs(lower), v_splat(0x1p-16f),
                  v_madd(v_splat(primitive->error), v_splat(2.0f), lower));
}

static inline float near_distance(const struct limits *limits) {
    return (float)(limits->hit_distance + 4.0 * limits->normal_step);
}

static inline struct packet_rays eye_rays(struct march_scratch *scratch,
                                          const struct prepared *scene) {
    return single_packet(scratch->eye, scene->all, scratch->eye_wake);
}

// Of the shapes of the scene the wanted ones, in both orders, written to `shapes`.
struct shape_list list_wanted(const bool *wanted, const struct prepared *scene, int *shapes);
// The same for rays that are to be hit: all shapes where a Mandelbulb is wanted. Its estimate is no bound, a march leaps
// over what is thin, and what it finds hangs on every step from the ray's origin on.
struct shape_list list_wanted_hits(const bool *wanted, const struct prepared *scene, int *shapes);

#endif
