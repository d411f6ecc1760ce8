// Lanes of floats: common/simd's, and what tile.c asks for besides. number.h says what each operation is.
#ifndef FIXED_LANES_H
#define FIXED_LANES_H

#include <stdint.h>

#include "simd/simd.h"

typedef vfloat vnum;

static inline vnum v_add(vnum a, vnum b) {
    return a + b;
}

static inline vnum v_sub(vnum a, vnum b) {
    return a - b;
}

static inline vnum v_mul_wide(vnum a, vnum b) {
    return a * b;
}

static inline bool v_mask_lane(vmask a, int lane) {
    return v_mask_bits(a) >> lane & 1;
}

static inline vmask v_positive(vnum a) {
    return v_cmp_lt(v_splat(0), a);
}

static inline vindex v_whole(vnum a) {
#if LANES == 16
    return _mm512_cvtps_epi32(a);
#else
    return _mm256_cvtps_epi32(a);
#endif
}

static inline vnum v_lookup(const float *table, vnum at) {
    return v_gather(table, v_whole(at));
}

static inline vmask v_test_bit(vnum a, int k) {
#if LANES == 16
    return (vmask){_mm512_test_epi32_mask(v_whole(a), _mm512_set1_epi32(1 << k))};
#else
    const __m256i bit = _mm256_set1_epi32(1 << k);
    return (vmask){_mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(v_whole(a), bit), bit))};
#endif
}

static inline void v_store_float(vnum a, double scale, float to[LANES]) {
    v_store(a * v_splat((float)scale), to);
}

static inline void v_store_double(vnum a, double scale, double to[LANES]) {
    float lanes[LANES];
    v_store(a, lanes);
    for (int lane = 0; lane < LANES; lane++)
        to[lane] = lanes[lane] * scale;
}

#endif
