// Four lanes: SSE2, which every x86-64 has. See simd.h. Multiply-adds are rounded twice: SSE2 has no fused ones.
#pragma once

typedef __m128 vfloat;
typedef struct {
    __m128 bits; // all bits of a lane set, or none
} vmask;
typedef __m128i vindex; // a whole number in each lane

#define MM(name) _mm_##name
#define BITS(a) _mm_castps_si128(a)
#define FLOATS(a) _mm_castsi128_ps(a)
#define BITS_AND _mm_and_si128
#define BITS_OR _mm_or_si128
#define COMPARED(name, predicate) _mm_cmp##name##_ps(a, b)
#define COMPARED_IN(name, predicate) v_and(m, v_cmp_##name(a, b)).bits
#include "simd/words.h"

static inline vfloat v_iota(void) {
    return _mm_setr_ps(0, 1, 2, 3);
}

static inline vmask v_mask_of_bits(unsigned which) {
    const __m128i one = _mm_setr_epi32(1, 2, 4, 8);
    __m128i its = _mm_and_si128(_mm_set1_epi32((int)which), one);
    return (vmask){_mm_castsi128_ps(_mm_cmpeq_epi32(its, one))};
}

static inline vfloat v_select(vmask m, vfloat yes, vfloat no) {
    return _mm_or_ps(_mm_and_ps(m.bits, yes), _mm_andnot_ps(m.bits, no));
}

static inline vfloat v_madd_where(vmask m, vfloat a, vfloat b, vfloat c) {
    return v_select(m, a * b + c, a);
}

#define REDUCTION(name)                                                                            \
    static inline float v_reduce_##name(vfloat a) {                                                \
        a = _mm_##name##_ps(a, _mm_movehl_ps(a, a));                                               \
        return _mm_cvtss_f32(_mm_##name##_ss(a, _mm_shuffle_ps(a, a, 1)));                         \
    }
REDUCTION(min)
REDUCTION(max)
#undef REDUCTION

static inline vfloat v_max_of_lanes(vfloat a) {
    a = v_max(a, _mm_shuffle_ps(a, a, 0x4e));
    return v_max(a, _mm_shuffle_ps(a, a, 0xb1));
}

// Precondition: |a| < 2^31, because SSE2 rounds by way of whole numbers.
static inline vfloat v_floor(vfloat a) {
    vfloat near = _mm_cvtepi32_ps(_mm_cvtps_epi32(a));
    return near - v_select_or_zero(v_cmp_gt(near, a), v_splat(1.0f));
}

static inline vfloat v_round(vfloat a) {
    return _mm_cvtepi32_ps(_mm_cvtps_epi32(a));
}

static inline vfloat v_madd(vfloat a, vfloat b, vfloat c) {
    return a * b + c;
}

static inline vfloat v_nmadd(vfloat a, vfloat b, vfloat c) {
    return c - a * b;
}

static inline vfloat v_msub(vfloat a, vfloat b, vfloat c) {
    return a * b - c;
}

static inline void v_compress_store(vmask m, vfloat a, float to[LANES]) {
    float lanes[LANES];
    v_store(a, lanes);
    for (unsigned rest = v_mask_bits(m); rest; rest &= rest - 1)
        *to++ = lanes[__builtin_ctz(rest)];
}
