// AVX-512 F and DQ in pairs of AVX2 registers, for tests of 16-lane code on machines without them (rules.mk: EMULATE=1).
//
// This file stands before the compiler's own <immintrin.h>. Types and AVX2 are the compiler's; the intrinsics of 512
// bits are SIMDe's (https://github.com/simd-everywhere/simde, package libsimde-dev, 0.7.4), and below are those that
// it lacks, lane by lane as "Operation" has them in Intel's Software Developer's Manual, volume 2. What is in neither
// does not compile: the compiler's own wants -mavx512f. tests/common/test_emulated.py holds pictures of 16 lanes against
// those of 8.
//
// The same bits as the instruction: all but rsqrt14 and rcp14, whose bits are Intel's own (relative error below
// 2^-14). Here they are the root or inverse in double, rounded to 14 bits: what is made from them is as near to truth,
// but not equal bit by bit. Exceptions' flags are not kept, and MXCSR's rounding is taken to be to nearest.
//
// Memory is read and written by C alone, each active lane its own, so that the sanitizers see every access.
#ifndef STEPWISE_EMULATED
#define STEPWISE_EMULATED

#include_next <immintrin.h>
#if defined __AVX512F__ || !defined __AVX2__ || !defined __FMA__
#error "emulated lanes are built with -mavx2 -mfma and without -mavx512f"
#endif
#if !__has_include(<simde/x86/avx512.h>)
#error "EMULATE=1 needs SIMDe: apt-get install libsimde-dev"
#endif
#define SIMDE_X86_AVX512F_ENABLE_NATIVE_ALIASES
#define SIMDE_X86_AVX512DQ_ENABLE_NATIVE_ALIASES
#include <math.h>
#include <simde/x86/avx512.h>
#include <stdint.h>
#include <string.h>

#define EMULATED static inline __attribute__((always_inline))
#define EACH(i, count) for (int i = 0; i < (count); i++)

typedef union {
    __m512 all;
    __m256 half[2];
    float lane[16];
    uint32_t bits[16];
} floats_;

typedef union {
    __m512d all;
    __m256d half[2];
    double lane[8];
    uint64_t bits[8];
} doubles_;

typedef union {
    __m512i all;
    __m256i half[2];
    int64_t lane[8];
} wholes_;

// Masks

#define _cvtmask16_u32(a) ((unsigned)(__mmask16)(a))
#define _knot_mask16(a) ((__mmask16) ~(a))
#define _kand_mask16(a, b) ((__mmask16)((a) & (b)))
#define _kand_mask8(a, b) ((__mmask8)((a) & (b)))
#define _kandn_mask16(a, b) ((__mmask16)(~(a) & (b)))
#define _kandn_mask8(a, b) ((__mmask8)(~(a) & (b)))
#define _kor_mask16(a, b) ((__mmask16)((a) | (b)))
#define _kor_mask8(a, b) ((__mmask8)((a) | (b)))
#define _kortestz_mask16_u8(a, b) ((unsigned char)((__mmask16)((a) | (b)) == 0))
#define _kortestz_mask8_u8(a, b) ((unsigned char)((__mmask8)((a) | (b)) == 0))
#define _kortestc_mask16_u8(a, b) ((unsigned char)((__mmask16)((a) | (b)) == 0xffff))

#undef _mm512_mask_cmp_ps_mask
#define _mm512_mask_cmp_ps_mask(k, a, b, how) _kand_mask16(k, _mm512_cmp_ps_mask(a, b, how))

EMULATED __mmask8 emulated_cmplt_epi64_mask(__m512i a, __m512i b) {
    wholes_ x = {a}, y = {b};
    unsigned k = 0;
    EACH(i, 8) k |= (unsigned)(x.lane[i] < y.lane[i]) << i;
    return (__mmask8)k;
}
#undef _mm512_cmplt_epi64_mask
#define _mm512_cmplt_epi64_mask(a, b) emulated_cmplt_epi64_mask(a, b)

// Lanes that move

#undef _mm512_cvtss_f32
#define _mm512_cvtss_f32(a) (((floats_){a}).lane[0])
#undef _mm512_extractf32x8_ps
#define _mm512_extractf32x8_ps(a, i) (((floats_){a}).half[(i) & 1])

// SIMDe's packs in place, in a loop that it declares free of dependences.
EMULATED __m512 emulated_maskz_compress_ps(__mmask16 k, __m512 a) {
    floats_ from = {a}, to = {_mm512_setzero_ps()};
    int next = 0;
    EACH(i, 16) if (k >> i & 1) to.lane[next++] = from.lane[i];
    return to.all;
}
#undef _mm512_maskz_compress_ps
#define _mm512_maskz_compress_ps(k, a) emulated_maskz_compress_ps(k, a)

EMULATED __m512 emulated_mask_expandloadu_ps(__m512 a, __mmask16 k, const void *from) {
    floats_ to = {a};
    const char *next = from;
    EACH(i, 16) if (k >> i & 1) {
        memcpy(&to.lane[i], next, sizeof(float));
        next += sizeof(float);
    }
    return to.all;
}
#undef _mm512_mask_expandloadu_ps
#define _mm512_mask_expandloadu_ps(a, k, from) emulated_mask_expandloadu_ps(a, k, from)

EMULATED __m512 emulated_mask_expand_ps(__m512 a, __mmask16 k, __m512 b) {
    floats_ from = {b};
    return emulated_mask_expandloadu_ps(a, k, from.lane);
}
#undef _mm512_mask_expand_ps
#define _mm512_mask_expand_ps(a, k, b) emulated_mask_expand_ps(a, k, b)

// The same lanes move; their bits are no floats'.
#undef _mm512_maskz_compress_epi32
#define _mm512_maskz_compress_epi32(k, a)                                                          \
    _mm512_castps_si512(emulated_maskz_compress_ps(k, _mm512_castsi512_ps(a)))
#undef _mm512_mask_expand_epi32
#define _mm512_mask_expand_epi32(a, k, b)                                                          \
    _mm512_castps_si512(emulated_mask_expand_ps(_mm512_castsi512_ps(a), k, _mm512_castsi512_ps(b)))

EMULATED void emulated_mask_storeu_ps(void *to, __mmask16 k, __m512 a) {
    floats_ from = {a};
    EACH(i, 16) {
        if (k >> i & 1)
            memcpy((char *)to + sizeof(float) * (size_t)i, &from.lane[i], sizeof(float));
    }
}
#undef _mm512_mask_storeu_ps
#define _mm512_mask_storeu_ps(to, k, a) emulated_mask_storeu_ps(to, k, a)

EMULATED void emulated_stream_ps(void *to, __m512 a) {
    *(__m512 *)to = a; // where it is a multiple of 64, as the instruction wants it: UBSan asks
}
#undef _mm512_stream_ps
#define _mm512_stream_ps(to, a) emulated_stream_ps(to, a)

EMULATED __m512 emulated_i32gather_ps(__m512i at, const void *from, int scale) {
    union {
        __m512i all;
        int32_t lane[16];
    } x = {at};
    floats_ to;
    EACH(i, 16) memcpy(&to.lane[i], (const char *)from + (int64_t)x.lane[i] * scale, sizeof(float));
    return to.all;
}
#undef _mm512_i32gather_ps
#define _mm512_i32gather_ps(at, from, scale) emulated_i32gather_ps(at, from, scale)

EMULATED __m512i emulated_i64gather_epi64(__m512i at, const void *from, int scale) {
    wholes_ x = {at}, to;
    EACH(i, 8) memcpy(&to.lane[i], (const char *)from + x.lane[i] * scale, sizeof(int64_t));
    return to.all;
}
#undef _mm512_i64gather_epi64
#define _mm512_i64gather_epi64(at, from, scale) emulated_i64gather_epi64(at, from, scale)

// Numbers

#define BY_HALVES(name, Result, result, Argument, argument)                                        \
    EMULATED Result emulated_##name(Argument a) {                                                  \
        argument from = {a};                                                                       \
        result to;                                                                                 \
        EACH(i, 2) to.half[i] = _mm256_##name(from.half[i]);                                       \
        return to.all;                                                                             \
    }
BY_HALVES(cvtepi32_ps, __m512, floats_, __m512i, wholes_)
BY_HALVES(cvtps_epi32, __m512i, wholes_, __m512, floats_)
BY_HALVES(floor_ps, __m512, floats_, __m512, floats_)
BY_HALVES(floor_pd, __m512d, doubles_, __m512d, doubles_)
#undef _mm512_cvtepi32_ps
#undef _mm512_cvtps_epi32
#undef _mm512_floor_ps
#undef _mm512_floor_pd
#define _mm512_cvtepi32_ps(a) emulated_cvtepi32_ps(a)
#define _mm512_cvtps_epi32(a) emulated_cvtps_epi32(a)
#define _mm512_floor_ps(a) emulated_floor_ps(a)
#define _mm512_floor_pd(a) emulated_floor_pd(a)

EMULATED __m512d emulated_cvtepi64_pd(__m512i a) {
    wholes_ x = {a};
    doubles_ to;
    EACH(i, 8) to.lane[i] = (double)x.lane[i];
    return to.all;
}
#undef _mm512_cvtepi64_pd
#define _mm512_cvtepi64_pd(a) emulated_cvtepi64_pd(a)

EMULATED __m256 emulated_cvtpd_ps(__m512d a) {
    doubles_ x = {a};
    return _mm256_set_m128(_mm256_cvtpd_ps(x.half[1]), _mm256_cvtpd_ps(x.half[0]));
}
#undef _mm512_cvtpd_ps
#define _mm512_cvtpd_ps(a) emulated_cvtpd_ps(a)

EMULATED __m512d emulated_cvtps_pd(__m256 a) {
    doubles_ to;
    to.half[0] = _mm256_cvtps_pd(_mm256_castps256_ps128(a));
    to.half[1] = _mm256_cvtps_pd(_mm256_extractf128_ps(a, 1));
    return to.all;
}
#undef _mm512_cvtps_pd
#define _mm512_cvtps_pd(a) emulated_cvtps_pd(a)

// Right with the sign, each lane its own way; all of its sign by 64 and more.
EMULATED __m512i emulated_srav_epi64(__m512i a, __m512i by) {
    wholes_ x = {a}, n = {by};
    EACH(i, 8) x.lane[i] >>= (uint64_t)n.lane[i] < 64 ? n.lane[i] : 63;
    return x.all;
}
#undef _mm512_srav_epi64
#define _mm512_srav_epi64(a, by) emulated_srav_epi64(a, by)

// The compilers' reductions: halves on halves, the upper as first operand.
#define REDUCED(name, op)                                                                          \
    EMULATED float emulated_##name(__m512 a) {                                                     \
        floats_ x = {a};                                                                           \
        __m256 h = _mm256_##op##_ps(x.half[1], x.half[0]);                                         \
        __m128 q = _mm_##op##_ps(_mm256_extractf128_ps(h, 1), _mm256_castps256_ps128(h));          \
        q = _mm_##op##_ps(q, _mm_shuffle_ps(q, q, 0x4e));                                          \
        return _mm_cvtss_f32(_mm_##op##_ps(q, _mm_shuffle_ps(q, q, 0xb1)));                        \
    }
REDUCED(reduce_max_ps, max)
REDUCED(reduce_min_ps, min)
#undef _mm512_reduce_max_ps
#define _mm512_reduce_max_ps(a) emulated_reduce_max_ps(a)
#undef _mm512_reduce_min_ps
#define _mm512_reduce_min_ps(a) emulated_reduce_min_ps(a)

// Bits of a float with its exponent in *exponent and without it in the return value (1 to 2, as bits, no sign);
// denormals as if they were normal. Of finite a that is not 0.
EMULATED uint32_t emulated_split(uint32_t a, int *exponent) {
    uint32_t fraction = a & 0x7fffff;
    *exponent = (int)(a >> 23 & 0xff) - 127;
    if (*exponent == -127) {
        int up = __builtin_clz(fraction) - 8;
        fraction = fraction << up & 0x7fffff;
        *exponent = -126 - up;
    }
    return fraction | 0x3f800000;
}

EMULATED __m512 emulated_getexp_ps(__m512 a) {
    floats_ x = {a};
    EACH(i, 16) {
        uint32_t size = x.bits[i] & 0x7fffffff;
        int exponent = 0;
        if (size > 0x7f800000)
            x.bits[i] |= 0x400000;
        else if (size == 0x7f800000 || size == 0)
            x.lane[i] = size ? INFINITY : -INFINITY;
        else {
            emulated_split(size, &exponent);
            x.lane[i] = (float)exponent;
        }
    }
    return x.all;
}
#undef _mm512_getexp_ps
#define _mm512_getexp_ps(a) emulated_getexp_ps(a)

// From 3/4 to 3/2, with the sign of a.
EMULATED __m512 emulated_getmant_p75_ps(__m512 a) {
    floats_ x = {a};
    EACH(i, 16) {
        uint32_t size = x.bits[i] & 0x7fffffff, sign = x.bits[i] & 0x80000000, one = 0x3f800000;
        int exponent;
        if (size > 0x7f800000) {
            x.bits[i] |= 0x400000;
            continue;
        }
        if (size != 0x7f800000 && size != 0)
            one = emulated_split(size, &exponent);
        x.bits[i] = sign | (one & 0x400000 ? one - 0x800000 : one);
    }
    return x.all;
}
#undef _mm512_getmant_ps
#define _mm512_getmant_ps(a, interval, from)                                                       \
    __extension__({                                                                                \
        _Static_assert((interval) == _MM_MANT_NORM_p75_1p5 && (from) == _MM_MANT_SIGN_src,         \
                       "of getmant one interval is emulated");                                     \
        emulated_getmant_p75_ps(a);                                                                \
    })

// Rounded to 14 bits: not the instruction's.
EMULATED double emulated_14_bits(double a) {
    uint64_t bits;
    memcpy(&bits, &a, sizeof bits);
    if (isfinite(a))
        bits = (bits + (UINT64_C(1) << 38)) & ~((UINT64_C(1) << 39) - 1);
    memcpy(&a, &bits, sizeof a);
    return a;
}

EMULATED __m512 emulated_rcp14_ps(__m512 a) {
    floats_ x = {a};
    EACH(i, 16) x.lane[i] = (float)emulated_14_bits(1 / (double)x.lane[i]);
    return x.all;
}
#undef _mm512_rcp14_ps
#define _mm512_rcp14_ps(a) emulated_rcp14_ps(a)

// 1/√0 keeps the zero's sign; below it there is none.
EMULATED double emulated_rsqrt14(double a) {
    return a < 0 ? (double)NAN : emulated_14_bits(1 / __builtin_sqrt(a));
}

EMULATED __m512 emulated_rsqrt14_ps(__m512 a) {
    floats_ x = {a};
    EACH(i, 16) x.lane[i] = (float)emulated_rsqrt14((double)x.lane[i]);
    return x.all;
}
#undef _mm512_rsqrt14_ps
#define _mm512_rsqrt14_ps(a) emulated_rsqrt14_ps(a)

EMULATED __m512d emulated_rsqrt14_pd(__m512d a) {
    doubles_ x = {a};
    EACH(i, 8) x.lane[i] = emulated_rsqrt14(x.lane[i]);
    return x.all;
}
#undef _mm512_rsqrt14_pd
#define _mm512_rsqrt14_pd(a) emulated_rsqrt14_pd(a)

#undef EMULATED
#undef EACH
#undef REDUCED

#endif
