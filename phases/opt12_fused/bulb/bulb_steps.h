// The steps of the marches to a Mandelbulb, which end on its exact surface: |zₙ| = 1, where the estimate h changes its
// sign. The estimate is no bound, so no step is proved: PROOFS.md tells what these miss.
#pragma once

#include "simd/simd.h"

#define FAR_SHARE 1.5f        // of h: a step far from the surface
#define SECANT_ESTIMATE 1e-4f // below it, steps are the secant's: from h
#define SECANT_SHARE 3.0f     // to so many times h
#define PAST_SHARE 0.2f       // of the hit distance: how far behind the secant's root a step aims

enum {
    S_LAST_H,
    S_LAST_STEP,
    STEP_FIELDS
}; // kept of each close ray: its last estimate and step, from 0 on

// A march starts where the ray enters the bounding sphere, for outside of it h may exceed the distance.
static inline void start_at(vfloat *t, vfloat *rest, vfloat entry) {
    vmask outside = v_cmp_lt(*t, entry);
    *rest = v_zero_where(outside, *rest);
    *t = v_select(outside, entry, *t);
}

// Far off (bulb/bulb_march.c). close: estimate below which a ray goes on in bulb/bulb_chebyshev.c, inside or not. A
// plane needs no heed: rays end where they hit it.
static inline vfloat far_step(vmask live, vfloat h, vfloat height, vfloat hit_distance,
                              vfloat close, vmask *reached) {
    (void)height;
    *reached = v_andnot(v_cmp_lt(h, close), v_cmp_lt_in(live, h, hit_distance));
    return h * v_splat(FAR_SHARE);
}

// Close to the surface (bulb/bulb_chebyshev.c): to the root of the secant through the last two estimates. Outside, each
// step reaches past the root, so that only a change of sign is a hit. From inside a ray goes back. It has landed once
// |h| is below the hit distance on either side of a crossing; its last step is to the root.
static inline vfloat close_step(vfloat *state, vmask live, vfloat h, vfloat height,
                                vfloat hit_distance, vmask *reached) {
    (void)height;
    vfloat zero = v_splat(0.0f), size = v_abs(h);
    vfloat last_h = state[S_LAST_H], last_step = state[S_LAST_STEP];
    vfloat root = h * last_step * v_rcp_approx(last_h - h);
    vmask inside = v_cmp_lt(h, zero), was_inside = v_cmp_lt(last_h, zero);
    vmask first = v_cmp_eq(last_step, zero), near = v_cmp_lt(h, v_splat(SECANT_ESTIMATE));
    vmask falls = v_and(v_andnot(first, near), v_cmp_lt(h, last_h));
    vfloat on = v_select(falls, v_max(v_min(root, h * v_splat(SECANT_SHARE)), h), h);
    on = v_select(was_inside, root, v_madd(hit_distance, v_splat(PAST_SHARE), on));
    vfloat back = v_select(v_andnot(first, v_cmp_lt(root, zero)), root, h * v_splat(4.0f));
    vfloat step = v_select(inside, back, on);
    *reached = v_cmp_lt_in(v_and(live, v_or(inside, was_inside)), size, hit_distance);
    state[S_LAST_H] = v_select(live, h, last_h);
    state[S_LAST_STEP] = v_select(live, step, last_step);
    return step;
}
