// Eight rays at once: every value is a lane of a 256-bit register, vectors are three of them
// (structure of arrays), conditions are masks.
//
// gcc's and clang's operators on __m256 are used for + − × ÷; fused multiply-adds are written out,
// since contraction is off.
#ifndef OPT4_VEC_H
#define OPT4_VEC_H

#include <immintrin.h>
#include <math.h>
#include <stdbool.h>

#include "counting/flops.h"

enum { LANES = 8 };

typedef __m256 real;
typedef __m256 mask; // all bits of a lane set, or none

struct vec {
    real x, y, z;
};

static inline real set(float a) {
    return _mm256_set1_ps(a);
}

static inline mask less(real a, real b) {
    return _mm256_cmp_ps(a, b, _CMP_LT_OQ);
}

static inline mask greater(real a, real b) {
    return _mm256_cmp_ps(a, b, _CMP_GT_OQ);
}

static inline mask not_less(real a, real b) {
    return _mm256_cmp_ps(a, b, _CMP_GE_OQ);
}

static inline mask both(mask a, mask b) {
    return _mm256_and_ps(a, b);
}

static inline mask either(mask a, mask b) {
    return _mm256_or_ps(a, b);
}

// b where not a
static inline mask but_not(mask a, mask b) {
    return _mm256_andnot_ps(a, b);
}

static inline mask not_in(mask a) {
    return _mm256_xor_ps(a, _mm256_castsi256_ps(_mm256_set1_epi32(-1)));
}

static inline int bits(mask a) {
    return _mm256_movemask_ps(a);
}

// Lanes of a mask: what a counting build asks, and a timing build never does.
static inline int count_of(mask a) {
    return __builtin_popcount((unsigned)bits(a));
}

static inline real choose(mask m, real yes, real no) {
    return _mm256_blendv_ps(no, yes, m);
}

static inline real least_of(real a, real b) {
    return _mm256_min_ps(a, b);
}

static inline real most_of(real a, real b) {
    return _mm256_max_ps(a, b);
}

static inline real absolute(real a) { // clear the sign bit
    return _mm256_andnot_ps(set(-0.0f), a);
}

static inline real negate_where(mask m, real a) {
    return _mm256_xor_ps(a, _mm256_and_ps(m, set(-0.0f)));
}

// The magnitude of `a` with the sign of `from`.
static inline real with_sign_of(real from, real a) {
    return _mm256_or_ps(_mm256_and_ps(set(-0.0f), from), absolute(a));
}

static inline real root(real a) {
    return _mm256_sqrt_ps(a);
}

// a·b + c, c − a·b, a·b − c
static inline real mul_add(real a, real b, real c) {
    return _mm256_fmadd_ps(a, b, c);
}

static inline real neg_mul_add(real a, real b, real c) {
    return _mm256_fnmadd_ps(a, b, c);
}

static inline real mul_sub(real a, real b, real c) {
    return _mm256_fmsub_ps(a, b, c);
}

static inline struct vec vec_set(const float *a) {
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
    return vec_along(d, n, set(-2.0f) * vec_dot(d, n));
}

// What float needs to stand beside double: a sum and a product with their rounding errors (T. J.
// Dekker, "A floating-point technique for extending the available precision", Numer. Math. 18
// (1971); D. E. Knuth, TAOCP vol. 2, 4.2.2), and places as unevaluated sums of two floats.
struct place {
    struct vec hi, lo;
};

static inline void split(double a, float *hi, float *lo) {
    *hi = (float)a;
    *lo = (float)(a - *hi);
}

static inline real two_sum(real a, real b, real *error) {
    real sum = a + b, b_part = sum - a;
    *error = (a - (sum - b_part)) + (b - b_part);
    return sum;
}

static inline real place_along(real hi, real *lo, real direction, real t, real dt) {
    real way = direction * t, way_error = mul_sub(direction, t, way), sum_error;
    real sum = two_sum(hi, way, &sum_error);
    real rest = mul_add(direction, dt, way_error + (sum_error + *lo));
    real result = sum + rest;
    *lo = rest - (result - sum);
    return result;
}

// The place at distance t + dt along the ray, dt small beside t: exact to 2^-43 of the larger of
// origin and way as long as dt is under 2^-19 of t.
static inline struct place place_at(struct place origin, struct vec direction, real t, real dt) {
    COUNT(place_at, call);
    struct place p = origin;
    p.hi.x = place_along(p.hi.x, &p.lo.x, direction.x, t, dt);
    p.hi.y = place_along(p.hi.y, &p.lo.y, direction.y, t, dt);
    p.hi.z = place_along(p.hi.z, &p.lo.z, direction.z, t, dt);
    return p;
}

// a − b, rounded once to float: exact to an ulp of the *difference*.
static inline struct vec place_sub(struct place a, const float hi[3], const float lo[3]) {
    COUNT(place_sub, call);
    return (struct vec){(a.hi.x - set(hi[0])) + (a.lo.x - set(lo[0])),
                        (a.hi.y - set(hi[1])) + (a.lo.y - set(lo[1])),
                        (a.hi.z - set(hi[2])) + (a.lo.z - set(lo[2]))};
}

// Eight doubles: for what is asked once per ray, where float would drown the difference of two places.
typedef struct {
    __m256d low, high;
} wide;

struct wide_vec {
    wide x, y, z;
};

static inline wide wide_sum(real hi, real lo) {
    return (wide){_mm256_cvtps_pd(_mm256_castps256_ps128(hi)) +
                      _mm256_cvtps_pd(_mm256_castps256_ps128(lo)),
                  _mm256_cvtps_pd(_mm256_extractf128_ps(hi, 1)) +
                      _mm256_cvtps_pd(_mm256_extractf128_ps(lo, 1))};
}

static inline struct wide_vec wide_place(struct place p) {
    COUNT(wide_place, call);
    return (struct wide_vec){wide_sum(p.hi.x, p.lo.x), wide_sum(p.hi.y, p.lo.y),
                             wide_sum(p.hi.z, p.lo.z)};
}

static inline wide wide_less(wide a, double b) {
    __m256d both = _mm256_set1_pd(b);
    return (wide){a.low - both, a.high - both};
}

static inline struct wide_vec wide_from(struct wide_vec a, const double b[3]) {
    COUNT(wide_from, call);
    return (struct wide_vec){wide_less(a.x, b[0]), wide_less(a.y, b[1]), wide_less(a.z, b[2])};
}

static inline wide wide_mul(wide a, double b) {
    __m256d both = _mm256_set1_pd(b);
    return (wide){a.low * both, a.high * both};
}

static inline wide wide_mul_add(wide a, double b, wide c) {
    __m256d both = _mm256_set1_pd(b);
    return (wide){_mm256_fmadd_pd(a.low, both, c.low), _mm256_fmadd_pd(a.high, both, c.high)};
}

static inline wide wide_dot(struct wide_vec a, const double b[3]) {
    return wide_mul_add(a.x, b[0], wide_mul_add(a.y, b[1], wide_mul(a.z, b[2])));
}

static inline real narrow(wide a) {
    return _mm256_set_m128(_mm256_cvtpd_ps(a.high), _mm256_cvtpd_ps(a.low));
}

// log and exp: range reduction after Cody and Waite, "Software manual for the elementary functions"
// (1980); polynomials by Chebyshev interpolation, derived by scripts/polynomials.py. Errors
// measured over all floats of their ranges by tests/c/test_math_opt4.c.

// log a for normal a > 0. 0 and denormals read as 2^-127·(1 + fraction): finite, not −∞.
static inline real log_of(real a) {
    COUNT(log_of, call);
    __m256i raw = _mm256_castps_si256(a);
    real e =
        _mm256_cvtepi32_ps(_mm256_sub_epi32(_mm256_srli_epi32(raw, 23), _mm256_set1_epi32(127)));
    real m = _mm256_castsi256_ps(_mm256_or_si256(
        _mm256_and_si256(raw, _mm256_set1_epi32(0x007fffff)), _mm256_set1_epi32(0x3f800000)));
    mask high = greater(m, set(1.41421356f));
    m = choose(high, m * set(0.5f), m);
    e = e + both(high, set(1.0f));
    real f = m - set(1.0f), s = f / (m + set(1.0f)), u = s * s;
    real p = mul_add(u, set(0.29579949392f), set(0.39988780566f));
    p = mul_add(u, p, set(0.6666668504f));
    // 2s = f − s·f, and f is exact; ln 2 in two parts, the first exact times e
    real low_part = mul_sub(e, set(-2.12194440e-4f), s * neg_mul_add(u, p, f));
    return mul_add(e, set(0.693359375f), f + low_part);
}

// exp a; below −87 it stays at exp(−87) = 2e-38, above 88 at exp(88).
static inline real exp_of(real a) {
    COUNT(exp_of, call);
    a = least_of(most_of(a, set(-87.0f)), set(88.0f));
    real n = _mm256_round_ps(a * set(1.44269504f), _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
    real r = neg_mul_add(n, set(0.693359375f), a);
    r = neg_mul_add(n, set(-2.12194440e-4f), r);
    real p = mul_add(r, set(0.001392617612f), set(0.0083631730745f));
    p = mul_add(r, p, set(0.041666554662f));
    p = mul_add(r, p, set(0.16666577026f));
    p = mul_add(r, p, set(0.5f));
    real e = set(1.0f) + mul_add(r * r, p, r);
    __m256i power = _mm256_slli_epi32(_mm256_cvtps_epi32(n), 23); // n into the exponent
    return _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(e), power));
}

// a^b for a > 0: relative error about (2 + |b·ln a|) ulp; 0 gives at most 2^(-127·b).
static inline real power_of(real a, real b) {
    COUNT(power_of, call);
    return exp_of(b * log_of(a));
}

#endif
