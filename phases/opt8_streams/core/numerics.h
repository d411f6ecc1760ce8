// Approximate roots and quotients, with their costs.
#pragma once

#include "simd/simd.h"

// Returns 1/a by the approximation and one Newton step.
static inline vfloat rough_inverse(vfloat a) {
    vfloat r = v_rcp_approx(a);
    return r * v_nmadd(a, r, v_splat(2.0f));
}

// Returns scale·√a for normal a > 0, to a few ulp. Sets two factors of 1/a, whose product may be denormal.
static inline vfloat root_and_inverse(vfloat a, float scale, vfloat *one, vfloat *other) {
#if LANES == 16 // all by one Newton step from the same 14 bits
    vfloat r = v_rsqrt_approx(a), h = a * r, error = v_nmadd(h, r, v_splat(1.0f));
    *one = r;
    *other = v_madd(r, error, r);
    return h * v_madd(error, v_splat(0.5f * scale), v_splat(scale));
#else
    vfloat r = v_rsqrt_newton(a);
    *one = *other = r;
    return (a * r) * v_splat(scale);
#endif
}
