// Eight lanes: AVX2 and FMA. See simd.h.
#pragma once

typedef __m256 vfloat;
typedef __m256d vhalf; // doubles for half of the lanes
typedef struct {
    __m256 bits; // all bits of a lane set, or none
} vmask;
typedef __m256i vindex; // a whole number in each lane

#define MM(name) _mm256_##name
#define BITS(a) _mm256_castps_si256(a)
#define FLOATS(a) _mm256_castsi256_ps(a)
#define BITS_AND _mm256_and_si256
#define BITS_OR _mm256_or_si256
#define COMPARED(name, predicate) _mm256_cmp_ps(a, b, predicate)
#define COMPARED_IN(name, predicate) v_and(m, v_cmp_##name(a, b)).bits
#include "simd/words.h"

static inline vfloat v_iota(void) {
    return _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
}

static inline vmask v_mask_of_bits(unsigned which) {
    const __m256i one = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    __m256i its = _mm256_and_si256(_mm256_set1_epi32((int)which), one);
    return (vmask){_mm256_castsi256_ps(_mm256_cmpeq_epi32(its, one))};
}

static inline unsigned v_any_of_four(vmask a, vmask b, vmask c, vmask d) {
    __m256i ab = _mm256_packs_epi32(_mm256_castps_si256(a.bits), _mm256_castps_si256(b.bits));
    __m256i cd = _mm256_packs_epi32(_mm256_castps_si256(c.bits), _mm256_castps_si256(d.bits));
    __m256i none = _mm256_cmpeq_epi32(_mm256_packs_epi16(ab, cd), _mm256_setzero_si256());
    unsigned of_half = (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(none));
    return ~(of_half & of_half >> 4) & 15;
}

static inline vfloat v_select(vmask m, vfloat yes, vfloat no) {
    return _mm256_blendv_ps(no, yes, m.bits);
}

static inline vfloat v_madd_where(vmask m, vfloat a, vfloat b, vfloat c) {
    return _mm256_blendv_ps(a, _mm256_fmadd_ps(a, b, c), m.bits);
}

#define REDUCTION(name)                                                                            \
    static inline float v_reduce_##name(vfloat a) {                                                \
        __m128 b = _mm_##name##_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));        \
        b = _mm_##name##_ps(b, _mm_movehl_ps(b, b));                                               \
        return _mm_cvtss_f32(_mm_##name##_ss(b, _mm_movehdup_ps(b)));                              \
    }
REDUCTION(min)
REDUCTION(max)
#undef REDUCTION

static inline vfloat v_max_of_lanes(vfloat a) {
    a = v_max(a, _mm256_permute2f128_ps(a, a, 1));
    a = v_max(a, _mm256_shuffle_ps(a, a, 0x4e));
    return v_max(a, _mm256_shuffle_ps(a, a, 0xb1));
}

static inline vfloat v_round(vfloat a) {
    return _mm256_round_ps(a, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
}

static inline vhalf v_half_rsqrt_approx(vhalf a) {
    return _mm256_cvtps_pd(_mm_rsqrt_ps(_mm256_cvtpd_ps(a)));
}

static inline vhalf v_half_low(vfloat a) {
    return _mm256_cvtps_pd(_mm256_castps256_ps128(a));
}

static inline vhalf v_half_high(vfloat a) {
    return _mm256_cvtps_pd(_mm256_extractf128_ps(a, 1));
}

static inline vfloat v_from_halves(vhalf low, vhalf high) {
    return _mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low));
}
