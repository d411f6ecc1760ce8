// How fast a Mandelbulb's estimate may change along a ray of shadow/widest_bulb.c. Nobody has a bound.
#pragma once

#include "core/prepared.h"
#include "simd/vectors.h"

// Returns the slope that the search steps by at p, in the shape's frame.
static inline vfloat search_slope(struct vec p, const struct primitive *s) {
    (void)p, (void)s;
    return v_splat(1.0f);
}
