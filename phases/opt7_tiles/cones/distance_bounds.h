// Lower and upper bounds of a shape's distance, as cones and bundles need them: rounding errors are taken off.
#pragma once

#include "cones/march_scratch.h"
#include "core/packet_group.h"
#include "core/shape_distances.h"

// From afar the Mandelbulb's estimate is r·ln(r)/3. That is above its tangent at e²: r minus this.
#define FAR_TANGENT 2.48f

// Returns a lower bound of the distance from a point to where the march may report a hit of the shape.
__attribute__((always_inline)) static inline vfloat lower_bound(const struct local_ray *a, vfloat t,
                                                                const struct primitive *primitive) {
    vfloat d;
    if (primitive->trust == BOUND_BALL) {
        struct vec p = vec_along(a->origin, a->direction, t);
        d = vec_norm(primitive->repeated ? vec_wrapped(primitive, p) : p) - v_splat(primitive->a);
    } else
        d = distance_to_shape(a, t, primitive, primitive->repeated, primitive->eval,
                              primitive->type, v_mask_all());
    return v_nmadd(v_abs(d), v_splat(0x1p-18f), d - v_splat(primitive->error));
}

// Returns an upper bound of the distance, from its lower bound.
static inline vfloat upper_bound(vfloat lower, const struct primitive *primitive) {
    return v_madd(v_abs(lower), v_splat(0x1p-16f),
                  v_madd(v_splat(primitive->error), v_splat(2.0f), lower));
}

// Returns how near to a hit a shape must be for the normal there to need it.
static inline float near_distance(const struct limits *limits) {
    return (float)(limits->hit_distance + 4.0 * limits->normal_step);
}

static inline struct packet_rays probe_rays(struct march_scratch *scratch,
                                            const struct prepared *scene) {
    return single_packet(scratch->probe, scene->all, scratch->probe_wake);
}

// Lists the wanted shapes of the scene, in both orders, into `shapes`.
struct shape_list list_wanted(const bool *wanted, const struct prepared *scene, int *shapes);
// Lists the wanted shapes for rays that may be hit. If a fractal is wanted, the list has all shapes: its estimate
// is no bound, and what a march finds depends on every step from the ray's origin on.
struct shape_list list_wanted_hits(const bool *wanted, const struct prepared *scene, int *shapes);
