// Four rays at once: every value is a lane of a 256-bit register, vectors are three of them
// (structure of arrays), conditions are masks.
//
// gcc's and clang's operators on __m256d are used for + − × ÷; fused multiply-adds are written out,
// since contraction is off.
#ifndef OPT3_VEC_H
#define OPT3_VEC_H

#include <immintrin.h>
#include <math.h>
#include <stdbool.h>

#include "counting/flops.h"

enum { LANES = 4 };

typedef __m256d real;
typedef __m256d mask; // all bits of a lane set, or none

struct vec {
    real x, y, z;
};

static inline real set(double a) {
    return _mm256_set1_pd(a);
}

static inline mask less(real a, real b) {
    return _mm256_cmp_pd(a, b, _CMP_LT_OQ);
}

static inline mask greater(real a, real b) {
    return _mm256_cmp_pd(a, b, _CMP_GT_OQ);
}

static inline mask both(mask a, mask b) {
    return _mm256_and_pd(a, b);
}

static inline mask either(mask a, mask b) {
    return _mm256_or_pd(a, b);
}

// b where not a
static inline mask but_not(mask a, mask b) {
    return _mm256_andnot_pd(a, b);
}

static inline mask not_in(mask a) {
    return _mm256_xor_pd(a, _mm256_castsi256_pd(_mm256_set1_epi64x(-1)));
}

static inline int bits(mask a) {
    return _mm256_movemask_pd(a);
}

static inline real choose(mask m, real yes, real no) {
    return _mm256_blendv_pd(no, yes, m);
}

static inline real least_of(real a, real b) {
    return _mm256_min_pd(a, b);
}

static inline real most_of(real a, real b) {
    return _mm256_max_pd(a, b);
}

static inline real absolute(real a) { // clear the sign bit
    return _mm256_andnot_pd(set(-0.0), a);
}

static inline real negate_where(mask m, real a) {
    return _mm256_xor_pd(a, _mm256_and_pd(m, set(-0.0)));
}

static inline real root(real a) {
    return _mm256_sqrt_pd(a);
}

// a·b + c, c − a·b, a·b − c
static inline real mul_add(real a, real b, real c) {
    return _mm256_fmadd_pd(a, b, c);
}

static inline real neg_mul_add(real a, real b, real c) {
    return _mm256_fnmadd_pd(a, b, c);
}

static inline real mul_sub(real a, real b, real c) {
    return _mm256_fmsub_pd(a, b, c);
}

static inline struct vec vec_set(const double *a) {
    return (struct vec){set(a[0]), set(a[1]), set(a[2])};
}

static inline real vec_dot(struct vec a, struct vec b) {
    return mul_add(a.x, b.x, mul_add(a.y, b.y, a.z * b.z));
}

static inline real vec_norm(struct vec a) {
    return root(vec_dot(a, a));
}

static inline struct vec vec_scale(struct vec a, real s) {
    return (struct vec){a.x * s, a.y * s, a.z * s};
}

// The points at distance t along the rays.
static inline struct vec vec_along(struct vec origin, struct vec direction, real t) {
    return (struct vec){mul_add(direction.x, t, origin.x), mul_add(direction.y, t, origin.y),
                        mul_add(direction.z, t, origin.z)};
}

static inline struct vec vec_choose(mask m, struct vec yes, struct vec no) {
    return (struct vec){choose(m, yes.x, no.x), choose(m, yes.y, no.y), choose(m, yes.z, no.z)};
}

// d mirrored at the plane with unit normal n.
static inline struct vec vec_reflect(struct vec d, struct vec n) {
    return vec_along(d, n, set(-2.0) * vec_dot(d, n));
}

// log and exp: range reduction after Cody and Waite, "Software manual for the elementary functions"
// (1980); polynomials by Chebyshev interpolation, derived by scripts/polynomials.py. Errors
// measured by tests/c/test_math_opt3.c: each under 2 ulp over the ranges said here.

// log a for normal a > 0. 0 and denormals read as 2^-1023·(1 + fraction): finite, not −∞.
static inline real log_of(real a) {
    COUNT(log_of, call);
    const __m256i mantissa = _mm256_set1_epi64x(0x000fffffffffffff);
    const __m256i one = _mm256_set1_epi64x(0x3ff0000000000000);
    __m256i raw = _mm256_castpd_si256(a);
    // 2^52 + exponent as a double, built from its bits
    __m256i biased =
        _mm256_or_si256(_mm256_srli_epi64(raw, 52), _mm256_set1_epi64x(0x4330000000000000));
    real e = _mm256_castsi256_pd(biased) - set(4503599627370496.0 + 1023.0);
    real m = _mm256_castsi256_pd(_mm256_or_si256(_mm256_and_si256(raw, mantissa), one));
    mask high = greater(m, set(1.4142135623730951));
    m = choose(high, m * set(0.5), m);
    e = e + both(high, set(1.0));
    real f = m - set(1.0), s = f / (m + set(1.0)), u = s * s;
    // Estrin's order: four short chains in place of one long
    real u2 = u * u, low = mul_add(u, set(0.3999999999989950449), set(0.66666666666666696862));
    real mid = mul_add(u, set(0.22222211134795079855), set(0.28571428625975484921));
    real high4 = mul_add(u, set(0.15331721600556041269), set(0.1818288912526172208));
    high4 = mul_add(u2, set(0.1461644968504340586), high4);
    real p = mul_add(u2 * u2, high4, mul_add(u2, mid, low));
    // 2s = f − s·f, and f is exact; ln 2 in two parts, the first exact times e
    real low_part = mul_sub(e, set(7.440617110012397e-11), s * neg_mul_add(u, p, f));
    return mul_add(e, set(0.6931471804855391), f + low_part);
}

// exp a; below −708 it stays at exp(−708) = 3e-308, above 709 at exp(709).
static inline real exp_of(real a) {
    COUNT(exp_of, call);
    a = least_of(most_of(a, set(-708.0)), set(709.0));
    const real shift = set(6755399441055744.0); // 1.5·2^52: adding it rounds to a whole number
    real shifted = mul_add(a, set(1.4426950408889634), shift);
    real n = shifted - shift;
    real r = neg_mul_add(n, set(0.6931471804855391), a);
    r = neg_mul_add(n, set(7.440617110012397e-11), r);
    real p = mul_add(r, set(2.5100375832561233664e-8), set(2.7620075879983366586e-7));
    p = mul_add(r, p, set(2.7557268480310025526e-6));
    p = mul_add(r, p, set(0.000024801521322368693266));
    p = mul_add(r, p, set(0.00019841269863040545271));
    p = mul_add(r, p, set(0.0013888888917196719077));
    p = mul_add(r, p, set(0.0083333333333300644495));
    p = mul_add(r, p, set(0.041666666666624161903));
    p = mul_add(r, p, set(0.16666666666666667452));
    p = mul_add(r, p, set(0.50000000000000010211));
    real e = set(1.0) + mul_add(r * r, p, r);
    __m256i power = _mm256_slli_epi64(_mm256_castpd_si256(shifted), 52); // n into the exponent
    return _mm256_castsi256_pd(_mm256_add_epi64(_mm256_castpd_si256(e), power));
}

// a^b for a > 0: relative error about (2 + |b·ln a|) ulp; 0 gives at most 2^(-1023·b).
static inline real power_of(real a, real b) {
    COUNT(power_of, call);
    return exp_of(b * log_of(a));
}

#endif
