// The light as a hit sees it.
#pragma once

#include "core/near_hit.h"
#include "phase.h"

static inline struct vec from_to(struct point from, const double to[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(to[i], &hi[i], &lo[i]);
    return vec_scale(point_sub(from, hi, lo), v_splat(-1.0f));
}

static inline struct lighting light_from(struct point p, struct vec n, vmask found,
                                         const struct view *view) {
    vfloat zero = v_splat(0.0f);
    struct vec to_light = from_to(p, view->light_position);
    vfloat distance = vec_norm(to_light);
    to_light = vec_scale(to_light, v_splat(1.0f) / distance);
    vfloat facing = vec_dot(n, to_light);
    // A surface turned away is unlit whatever the shadow. A light on the surface has no direction.
    vmask lit = v_and(found, v_and(v_cmp_gt(facing, zero), v_cmp_gt(distance, zero)));
    return (struct lighting){to_light, distance, facing, lit};
}
