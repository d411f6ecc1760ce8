// The steps of the marches to a Mandelbulb: by the lesser of the estimate h and the height over the plane. Both return
// the steps of the rays in `live`, and the rays that reach a surface by them.
#pragma once

#include "simd/simd.h"

enum { STEP_FIELDS = 0 }; // kept of each close ray, from 0 on

// A march starts at t + rest, the ray's origin. entry: where the ray enters the bounding sphere.
static inline void start_at(vfloat *t, vfloat *rest, vfloat entry) {
    (void)t, (void)rest, (void)entry;
}

// Far off (bulb/bulb_march.c). close: estimate below which a ray goes on in bulb/bulb_chebyshev.c.
static inline vfloat far_step(vmask live, vfloat h, vfloat height, vfloat hit_distance,
                              vfloat close, vmask *reached) {
    (void)close;
    vfloat least = v_min(h, height);
    *reached = v_cmp_lt_in(live, least, hit_distance);
    return least;
}

// Close to the surface (bulb/bulb_chebyshev.c).
static inline vfloat close_step(vfloat *state, vmask live, vfloat h, vfloat height,
                                vfloat hit_distance, vmask *reached) {
    (void)state;
    vfloat least = v_min(h, height);
    *reached = v_cmp_lt_in(live, least, hit_distance);
    return least;
}
