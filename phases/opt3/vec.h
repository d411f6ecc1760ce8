// Four rays at once: each lane of a 256-bit register belongs to one ray. A vector is three registers (a
// structure of arrays), a condition is a mask.
#pragma once

#include <immintrin.h>
#include <math.h>

#include "counting/flops.h"

enum { LANES = 4 };

typedef double real;
typedef __m256d vdouble, vreal;
#define AVX(name) _mm256_##name##_pd
#include "simd/avx2.h"

static inline vdouble v_sqrt(vdouble a) {
    return _mm256_sqrt_pd(a);
}

#include "simd/vec.h"

static inline struct vec vec_set(const double *a) {
    return (struct vec){v_splat(a[0]), v_splat(a[1]), v_splat(a[2])};
}

// log, exp and sin: range reduction after W. J. Cody and W. Waite, "Software manual for the elementary
// functions" (1980). The polynomials are Chebyshev interpolants made by scripts/stepwise polynomials.
// tests/c/phases/test_math_opt3.c measures the errors: below 2 ulp over the ranges given here.

// Returns log a for normal a > 0. 0 and denormals are read as 2^-1023·(1 + fraction), so that the
// result is finite.
static inline vdouble log_of(vdouble a) {
    COUNT(log_of, call);
    const __m256i mantissa = _mm256_set1_epi64x(0x000fffffffffffff);
    const __m256i one = _mm256_set1_epi64x(0x3ff0000000000000);
    __m256i raw = _mm256_castpd_si256(a);
    // The bits of the double 2^52 + biased exponent: the exponent without an integer conversion.
    __m256i biased =
        _mm256_or_si256(_mm256_srli_epi64(raw, 52), _mm256_set1_epi64x(0x4330000000000000));
    vdouble e = _mm256_castsi256_pd(biased) - v_splat(4503599627370496.0 + 1023.0);
    vdouble m = _mm256_castsi256_pd(_mm256_or_si256(_mm256_and_si256(raw, mantissa), one));
    vmask high = v_cmp_gt(m, v_splat(1.4142135623730951));
    m = v_select(high, m * v_splat(0.5), m);
    e = e + v_select_or_zero(high, v_splat(1.0));
    vdouble f = m - v_splat(1.0), s = f / (m + v_splat(1.0)), u = s * s;
    // Estrin's scheme: four short dependency chains instead of a long one.
    vdouble u2 = u * u,
            low = v_madd(u, v_splat(0.3999999999989950449), v_splat(0.66666666666666696862));
    vdouble mid = v_madd(u, v_splat(0.22222211134795079855), v_splat(0.28571428625975484921));
    vdouble high4 = v_madd(u, v_splat(0.15331721600556041269), v_splat(0.1818288912526172208));
    high4 = v_madd(u2, v_splat(0.1461644968504340586), high4);
    vdouble p = v_madd(u2 * u2, high4, v_madd(u2, mid, low));
    // 2s = f − s·f, where f is exact. ln 2 has two parts; the product of e and the first is exact.
    vdouble low_part = v_msub(e, v_splat(7.440617110012397e-11), s * v_nmadd(u, p, f));
    return v_madd(e, v_splat(0.6931471804855391), f + low_part);
}

// Returns exp a. The argument is clamped to −708 ... 709, so that the result is a normal number.
static inline vdouble exp_of(vdouble a) {
    COUNT(exp_of, call);
    a = v_min(v_max(a, v_splat(-708.0)), v_splat(709.0));
    const vdouble shift = v_splat(6755399441055744.0); // 1.5·2^52: adding it rounds to an integer
    vdouble shifted = v_madd(a, v_splat(1.4426950408889634), shift);
    vdouble n = shifted - shift;
    vdouble r = v_nmadd(n, v_splat(0.6931471804855391), a);
    r = v_nmadd(n, v_splat(7.440617110012397e-11), r);
    vdouble p = v_madd(r, v_splat(2.5100375832561233664e-8), v_splat(2.7620075879983366586e-7));
    p = v_madd(r, p, v_splat(2.7557268480310025526e-6));
    p = v_madd(r, p, v_splat(0.000024801521322368693266));
    p = v_madd(r, p, v_splat(0.00019841269863040545271));
    p = v_madd(r, p, v_splat(0.0013888888917196719077));
    p = v_madd(r, p, v_splat(0.0083333333333300644495));
    p = v_madd(r, p, v_splat(0.041666666666624161903));
    p = v_madd(r, p, v_splat(0.16666666666666667452));
    p = v_madd(r, p, v_splat(0.50000000000000010211));
    vdouble e = v_splat(1.0) + v_madd(r * r, p, r);
    __m256i power = _mm256_slli_epi64(_mm256_castpd_si256(shifted), 52); // n into the exponent
    return _mm256_castsi256_pd(_mm256_add_epi64(_mm256_castpd_si256(e), power));
}

// Returns a^b for a > 0. The relative error is about (2 + |b·ln a|) ulp; a = 0 gives at most
// 2^(-1023·b).
static inline vdouble power_of(vdouble a, vdouble b) {
    COUNT(power_of, call);
    return exp_of(b * log_of(a));
}

// Returns sin a, off by at most 2^-52 for |a| up to 1000.
static inline vdouble sin_of(vdouble a) {
    COUNT(sin_of, call);
    const vdouble shift = v_splat(6755399441055744.0); // 1.5·2^52: adding it rounds to an integer
    vdouble shifted = v_madd(a, v_splat(0.31830988618379067154), shift);
    vdouble n = shifted - shift;
    vdouble r = v_nmadd(n, v_splat(1.2246467991473532e-16), v_nmadd(n, v_splat(M_PI), a));
    vdouble u = r * r;
    vdouble p = v_madd(u, v_splat(2.7314447669863993424e-15), v_splat(-7.6439702967985720524e-13));
    p = v_madd(u, p, v_splat(1.6058977312464087621e-10));
    p = v_madd(u, p, v_splat(-2.5052107616996182891e-8));
    p = v_madd(u, p, v_splat(2.7557319219163233416e-6));
    p = v_madd(u, p, v_splat(-0.00019841269841254973769));
    p = v_madd(u, p, v_splat(0.0083333333333333158688));
    p = v_madd(u, p, v_splat(-0.16666666666666666633));
    // An odd n turns the sign: its lowest bit moves to the sign's place.
    __m256i sign = _mm256_slli_epi64(_mm256_castpd_si256(shifted), 63);
    return _mm256_xor_pd(v_madd(r * u, p, r), _mm256_castsi256_pd(sign));
}

static inline vdouble cos_of(vdouble a) {
    return sin_of(a + v_splat(0.5 * M_PI));
}

#define v_pow power_of // as packet/phong.h calls it
