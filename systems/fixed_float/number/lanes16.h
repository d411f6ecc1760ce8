// Sixteen lanes of floats: AVX-512 F and DQ. Included by lanes.h.
#ifndef FIXED_LANES16_H
#define FIXED_LANES16_H

#include <immintrin.h>

typedef __m512 vnum;
typedef __mmask16 vmask;

static inline vnum v_splat(float a) {
    return _mm512_set1_ps(a);
}

static inline vnum v_iota(void) {
    return _mm512_setr_ps(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}

static inline vnum v_load(const float from[LANES]) {
    return _mm512_loadu_ps(from);
}

static inline vnum v_add(vnum a, vnum b) {
    return a + b;
}

static inline vnum v_sub(vnum a, vnum b) {
    return a - b;
}

static inline vnum v_mul_wide(vnum a, vnum b) {
    return a * b;
}

static inline vnum v_madd(vnum a, vnum b, vnum c) {
    return _mm512_fmadd_ps(a, b, c);
}

static inline vnum v_sqrt_of(vnum a) {
    return _mm512_sqrt_ps(a);
}

static inline vmask v_cmp_lt(vnum a, vnum b) {
    return _mm512_cmp_ps_mask(a, b, _CMP_LT_OQ);
}

static inline vmask v_and(vmask a, vmask b) {
    return _kand_mask16(a, b);
}

static inline vmask v_or(vmask a, vmask b) {
    return _kor_mask16(a, b);
}

static inline vmask v_andnot(vmask a, vmask b) {
    return _kandn_mask16(a, b);
}

static inline bool v_any(vmask a) {
    return !_kortestz_mask16_u8(a, a);
}

static inline int v_count(vmask a) {
    return __builtin_popcount(a);
}

static inline bool v_mask_lane(vmask a, int lane) {
    return a >> lane & 1;
}

static inline vnum v_select(vmask m, vnum yes, vnum no) {
    return _mm512_mask_blend_ps(m, no, yes);
}

static inline vnum v_gather(const float *table, vnum at) {
    return _mm512_i32gather_ps(_mm512_cvtps_epi32(at), table, 4);
}

static inline vmask v_test_bit(vnum a, int k) {
    return _mm512_test_epi32_mask(_mm512_cvtps_epi32(a), _mm512_set1_epi32(1 << k));
}

static inline void v_store_double(vnum a, double scale, double to[LANES]) {
    const __m512d by = _mm512_set1_pd(scale);
    _mm512_storeu_pd(to, _mm512_cvtps_pd(_mm512_castps512_ps256(a)) * by);
    _mm512_storeu_pd(to + 8, _mm512_cvtps_pd(_mm512_extractf32x8_ps(a, 1)) * by);
}

static inline vmask v_positive(vnum a) {
    return v_cmp_lt(v_splat(0), a);
}

static inline vmask v_mask_first(int count) {
    return v_cmp_lt(v_iota(), v_splat((float)count));
}

static inline void v_store_float(vnum a, double scale, float to[LANES]) {
    _mm512_storeu_ps(to, a * v_splat((float)scale));
}

#endif
