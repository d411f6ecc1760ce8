// log, exp, pow, sin and cos. Part of simd.h.
#pragma once

// log and exp: range reduction after Cody and Waite, "Software manual for the elementary functions"
// (1980); polynomials by Chebyshev interpolation, derived by scripts/stepwise polynomials. Errors
// measured over all floats of their ranges by tests/c/phases/test_math_opt4.c.

// log a for normal a > 0. 0 and denormals read as 2^-127·(1 + fraction): finite, not −∞.
static inline vfloat v_log(vfloat a) {
    vfloat e = v_exponent(a), m = v_mantissa(a);
    vmask high = v_cmp_gt(m, v_splat(1.41421356f));
    m = v_select(high, m * v_splat(0.5f), m);
    e = e + v_select_or_zero(high, v_splat(1.0f));
    vfloat f = m - v_splat(1.0f), s = f / (m + v_splat(1.0f)), u = s * s;
    vfloat p = v_madd(u, v_splat(0.29579949392f), v_splat(0.39988780566f));
    p = v_madd(u, p, v_splat(0.6666668504f));
    // 2s = f − s·f, and f is exact; ln 2 in two parts, the first exact times e
    vfloat low_part = v_msub(e, v_splat(-2.12194440e-4f), s * v_nmadd(u, p, f));
    return v_madd(e, v_splat(0.693359375f), f + low_part);
}

// exp a for |a| < 0.346 (half of ln 2): v_exp(a), to the bit.
static inline vfloat v_exp_near_0(vfloat a) {
    vfloat p = v_madd(a, v_splat(0.001392617612f), v_splat(0.0083631730745f));
    p = v_madd(a, p, v_splat(0.041666554662f));
    p = v_madd(a, p, v_splat(0.16666577026f));
    p = v_madd(a, p, v_splat(0.5f));
    return v_splat(1.0f) + v_madd(a * a, p, a);
}

// exp a; below −87 it stays at exp(−87) = 2e-38, above 88 at exp(88).
static inline vfloat v_exp(vfloat a) {
    a = v_min(v_max(a, v_splat(-87.0f)), v_splat(88.0f));
    vfloat n = v_round(a * v_splat(1.44269504f));
    vfloat r = v_nmadd(n, v_splat(0.693359375f), a);
    r = v_nmadd(n, v_splat(-2.12194440e-4f), r);
    return v_ldexp(v_exp_near_0(r), n);
}

// a^b for a > 0: relative error about (2 + |b·ln a|) ulp; 0 gives at most 2^(-127·b).
static inline vfloat v_pow(vfloat a, vfloat b) {
    return v_exp(b * v_log(a));
}

// (-1)^parity sin r of r = a - n*pi, which is within pi/2 of 0: sin a for whole n = parity, -cos a for n = parity + 1/2.
// pi in two parts; the product of n and the first is exact. The polynomial is opt4's (scripts/stepwise polynomials).
static inline vfloat v_sine_near(vfloat a, vfloat n, vfloat parity) {
    vfloat r = v_nmadd(n, v_splat(9.67653590e-4f), v_nmadd(n, v_splat(3.140625f), a)), u = r * r;
    vfloat p = v_madd(u, v_splat(2.6347563918e-6f), v_splat(-0.00019822739489f));
    p = v_madd(u, p, v_splat(0.0083332421351f));
    p = v_madd(u, p, v_splat(-0.16666665964f));
    vfloat half = parity * v_splat(0.5f);
    return v_negate_where(v_cmp_gt(half, v_floor(half)), v_madd(r * u, p, r));
}

// sin a and cos a: off by at most 2^-22 for |a| up to 1000.
static inline vfloat v_sin(vfloat a) {
    vfloat n = v_round(a * v_splat(0.318309886f));
    return v_sine_near(a, n, n);
}

static inline vfloat v_cos(vfloat a) {
    vfloat n = v_floor(a * v_splat(0.318309886f));
    return v_splat(0.0f) - v_sine_near(a, n + v_splat(0.5f), n);
}
