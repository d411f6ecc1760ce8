// How fast a Mandelbulb's estimate may change along a ray of shadow/widest_bulb.c. Nobody has a bound.
#pragma once

#include "core/prepared.h"
#include "simd/vectors.h"

// Returns the slope that the search steps by at p, in the shape's frame. Within the bounding sphere the estimate mostly
// falls slower than the point moves; outside it is close to a distance.
static inline vfloat search_slope(struct vec p, const struct primitive *s) {
    vmask inside = v_cmp_lt(vec_dot(p, p), v_splat(s->bound_sq));
    return v_select(inside, v_splat(0.7f), v_splat(1.0f));
}
