// Eight rays at once: each lane of a 256-bit register belongs to one ray. A vector is three registers (a
// structure of arrays), a condition is a mask.
#pragma once

#include <immintrin.h>
#include <math.h>

#include "counting/flops.h"

enum { LANES = 8 };

typedef float real;
typedef __m256 vfloat, vreal;
#define AVX(name) _mm256_##name##_ps
#include "simd/avx2.h"

static inline vmask v_cmp_ge(vfloat a, vfloat b) {
    return (vmask){_mm256_cmp_ps(a, b, _CMP_GE_OQ)};
}

// The magnitude of a with the sign of `from`.
static inline vfloat v_copysign(vfloat a, vfloat from) {
    return _mm256_or_ps(_mm256_and_ps(v_splat(-0.0f), from), v_abs(a));
}

static inline vfloat v_sqrt(vfloat a) {
    return _mm256_sqrt_ps(a);
}

#include "simd/vec.h"

static inline struct vec vec_set(const float *a) {
    return (struct vec){v_splat(a[0]), v_splat(a[1]), v_splat(a[2])};
}

// a as a sum of two floats, to 2^-48 of a.
static inline void split(double a, float *hi, float *lo) {
    *hi = (float)a;
    *lo = (float)(a - *hi);
}

// The point at distance t + dt along the ray. Requires dt below 2^-19 of t. The error is at most
// 2^-43 of the larger of the origin's coordinate and t (tests/c/phases/test_math_opt4.c).
static inline struct point place_at(struct point origin, struct vec direction, vfloat t,
                                    vfloat dt) {
    COUNT(place_at, call);
    struct point p = origin;
    p.hi.x = point_along(p.hi.x, &p.lo.x, direction.x, t, dt);
    p.hi.y = point_along(p.hi.y, &p.lo.y, direction.y, t, dt);
    p.hi.z = point_along(p.hi.z, &p.lo.z, direction.z, t, dt);
    return p;
}

// a − (hi + lo), rounded once to float: the error is an ulp of the *difference*.
static inline struct vec place_sub(struct point a, const float hi[3], const float lo[3]) {
    COUNT(place_sub, call);
    return (struct vec){(a.hi.x - v_splat(hi[0])) + (a.lo.x - v_splat(lo[0])),
                        (a.hi.y - v_splat(hi[1])) + (a.lo.y - v_splat(lo[1])),
                        (a.hi.z - v_splat(hi[2])) + (a.lo.z - v_splat(lo[2]))};
}

// A double in each lane, in two registers. It serves what is computed once per ray, where float
// would lose the difference of two points.
typedef struct {
    __m256d low, high;
} vdouble;

struct vec_double {
    vdouble x, y, z;
};

static inline vdouble v_double_sum(vfloat hi, vfloat lo) {
    return (vdouble){_mm256_cvtps_pd(_mm256_castps256_ps128(hi)) +
                         _mm256_cvtps_pd(_mm256_castps256_ps128(lo)),
                     _mm256_cvtps_pd(_mm256_extractf128_ps(hi, 1)) +
                         _mm256_cvtps_pd(_mm256_extractf128_ps(lo, 1))};
}

static inline struct vec_double vec_double_of(struct point p) {
    COUNT(vec_double_of, call);
    return (struct vec_double){v_double_sum(p.hi.x, p.lo.x), v_double_sum(p.hi.y, p.lo.y),
                               v_double_sum(p.hi.z, p.lo.z)};
}

static inline vdouble v_double_sub(vdouble a, double b) {
    __m256d each = _mm256_set1_pd(b);
    return (vdouble){a.low - each, a.high - each};
}

static inline struct vec_double vec_double_sub(struct vec_double a, const double b[3]) {
    COUNT(vec_double_sub, call);
    return (struct vec_double){v_double_sub(a.x, b[0]), v_double_sub(a.y, b[1]),
                               v_double_sub(a.z, b[2])};
}

static inline vdouble v_double_mul(vdouble a, double b) {
    __m256d each = _mm256_set1_pd(b);
    return (vdouble){a.low * each, a.high * each};
}

static inline vdouble v_double_madd(vdouble a, double b, vdouble c) {
    __m256d each = _mm256_set1_pd(b);
    return (vdouble){_mm256_fmadd_pd(a.low, each, c.low), _mm256_fmadd_pd(a.high, each, c.high)};
}

static inline vdouble v_double_dot(struct vec_double a, const double b[3]) {
    return v_double_madd(a.x, b[0], v_double_madd(a.y, b[1], v_double_mul(a.z, b[2])));
}

static inline vfloat v_double_to_float(vdouble a) {
    return _mm256_set_m128(_mm256_cvtpd_ps(a.high), _mm256_cvtpd_ps(a.low));
}

// log, exp and sin: range reduction after W. J. Cody and W. Waite, "Software manual for the elementary
// functions" (1980). The polynomials are Chebyshev interpolants made by scripts/stepwise polynomials.
// tests/c/phases/test_math_opt4.c measures the errors: at most 1.5 ulp.

// Returns log a for normal a > 0. 0 and denormals are read as 2^-127·(1 + fraction), so that the
// result is finite.
static inline vfloat log_of(vfloat a) {
    COUNT(log_of, call);
    __m256i raw = _mm256_castps_si256(a);
    vfloat e =
        _mm256_cvtepi32_ps(_mm256_sub_epi32(_mm256_srli_epi32(raw, 23), _mm256_set1_epi32(127)));
    vfloat m = _mm256_castsi256_ps(_mm256_or_si256(
        _mm256_and_si256(raw, _mm256_set1_epi32(0x007fffff)), _mm256_set1_epi32(0x3f800000)));
    vmask high = v_cmp_gt(m, v_splat(1.41421356f));
    m = v_select(high, m * v_splat(0.5f), m);
    e = e + v_select_or_zero(high, v_splat(1.0f));
    vfloat f = m - v_splat(1.0f), s = f / (m + v_splat(1.0f)), u = s * s;
    vfloat p = v_madd(u, v_splat(0.29579949392f), v_splat(0.39988780566f));
    p = v_madd(u, p, v_splat(0.6666668504f));
    // 2s = f − s·f, where f is exact. ln 2 has two parts; the product of e and the first is exact.
    vfloat low_part = v_msub(e, v_splat(-2.12194440e-4f), s * v_nmadd(u, p, f));
    return v_madd(e, v_splat(0.693359375f), f + low_part);
}

// Returns exp a. The argument is clamped to −87 ... 88, so that the result is a normal number.
static inline vfloat exp_of(vfloat a) {
    COUNT(exp_of, call);
    a = v_min(v_max(a, v_splat(-87.0f)), v_splat(88.0f));
    vfloat n =
        _mm256_round_ps(a * v_splat(1.44269504f), _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
    vfloat r = v_nmadd(n, v_splat(0.693359375f), a);
    r = v_nmadd(n, v_splat(-2.12194440e-4f), r);
    vfloat p = v_madd(r, v_splat(0.001392617612f), v_splat(0.0083631730745f));
    p = v_madd(r, p, v_splat(0.041666554662f));
    p = v_madd(r, p, v_splat(0.16666577026f));
    p = v_madd(r, p, v_splat(0.5f));
    vfloat e = v_splat(1.0f) + v_madd(r * r, p, r);
    __m256i power = _mm256_slli_epi32(_mm256_cvtps_epi32(n), 23); // n into the exponent
    return _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(e), power));
}

// Returns a^b for a > 0. The relative error is about (2 + |b·ln a|) ulp; a = 0 gives at most
// 2^(-127·b).
static inline vfloat power_of(vfloat a, vfloat b) {
    COUNT(power_of, call);
    return exp_of(b * log_of(a));
}

// Returns sin a, off by at most 1.5·2^-23 for |a| up to 1000.
static inline vfloat sin_of(vfloat a) {
    COUNT(sin_of, call);
    vfloat n =
        _mm256_round_ps(a * v_splat(0.318309886f), _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
    vfloat r = v_nmadd(n, v_splat(-8.74227766e-8f), v_nmadd(n, v_splat(3.14159274f), a)), u = r * r;
    vfloat p = v_madd(u, v_splat(2.6347563918e-6f), v_splat(-0.00019822739489f));
    p = v_madd(u, p, v_splat(0.0083332421351f));
    p = v_madd(u, p, v_splat(-0.16666665964f));
    __m256i sign = _mm256_slli_epi32(_mm256_cvtps_epi32(n), 31); // an odd n turns the sign
    return _mm256_xor_ps(v_madd(r * u, p, r), _mm256_castsi256_ps(sign));
}

static inline vfloat cos_of(vfloat a) {
    return sin_of(a + v_splat(1.57079633f));
}

#define v_pow power_of // as packet/phong.h calls it
