// Sixteen lanes: AVX-512 F and DQ. See number.h.
#ifndef FIXED_LANES16_H
#define FIXED_LANES16_H

#include <immintrin.h>

typedef __m512 num;
typedef __mmask16 mask;

static inline num set(float a) {
    return _mm512_set1_ps(a);
}

static inline num ramp(void) {
    return _mm512_setr_ps(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}

static inline num load(const float from[LANES]) {
    return _mm512_loadu_ps(from);
}

static inline num plus(num a, num b) {
    return a + b;
}

static inline num minus(num a, num b) {
    return a - b;
}

static inline num product(num a, num b) {
    return a * b;
}

static inline num mul_add(num a, num b, num c) {
    return _mm512_fmadd_ps(a, b, c);
}

static inline num root_of(num a) {
    return _mm512_sqrt_ps(a);
}

static inline mask less(num a, num b) {
    return _mm512_cmp_ps_mask(a, b, _CMP_LT_OQ);
}

static inline mask both(mask a, mask b) {
    return _kand_mask16(a, b);
}

static inline mask either(mask a, mask b) {
    return _kor_mask16(a, b);
}

static inline mask but_not(mask a, mask b) {
    return _kandn_mask16(a, b);
}

static inline bool any(mask a) {
    return !_kortestz_mask16_u8(a, a);
}

static inline int count_of(mask a) {
    return __builtin_popcount(a);
}

static inline bool bit_of(mask a, int lane) {
    return a >> lane & 1;
}

static inline num choose(mask m, num yes, num no) {
    return _mm512_mask_blend_ps(m, no, yes);
}

static inline num look_up(const float *table, num at) {
    return _mm512_i32gather_ps(_mm512_cvtps_epi32(at), table, 4);
}

static inline mask bit_set(num a, int k) {
    return _mm512_test_epi32_mask(_mm512_cvtps_epi32(a), _mm512_set1_epi32(1 << k));
}

static inline void unload_wide(num a, double scale, double to[LANES]) {
    const __m512d by = _mm512_set1_pd(scale);
    _mm512_storeu_pd(to, _mm512_cvtps_pd(_mm512_castps512_ps256(a)) * by);
    _mm512_storeu_pd(to + 8, _mm512_cvtps_pd(_mm512_extractf32x8_ps(a, 1)) * by);
}

static inline mask positive(num a) {
    return less(set(0), a);
}

static inline mask first_lanes(int count) {
    return less(ramp(), set((float)count));
}

static inline void unload(num a, double scale, float to[LANES]) {
    _mm512_storeu_ps(to, a * set((float)scale));
}

#endif
