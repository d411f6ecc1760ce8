// Eight lanes: AVX2 and FMA. See number.h.
#ifndef FIXED_LANES8_H
#define FIXED_LANES8_H

#include <immintrin.h>

typedef __m256 num;
typedef struct {
    __m256 all; // all bits of a lane, or none
} mask;

static inline num set(float a) {
    return _mm256_set1_ps(a);
}

static inline num ramp(void) {
    return _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
}

static inline num load(const float from[LANES]) {
    return _mm256_loadu_ps(from);
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
    return _mm256_fmadd_ps(a, b, c);
}

static inline num root_of(num a) {
    return _mm256_sqrt_ps(a);
}

static inline mask less(num a, num b) {
    return (mask){_mm256_cmp_ps(a, b, _CMP_LT_OQ)};
}

static inline mask both(mask a, mask b) {
    return (mask){_mm256_and_ps(a.all, b.all)};
}

static inline mask either(mask a, mask b) {
    return (mask){_mm256_or_ps(a.all, b.all)};
}

static inline mask but_not(mask a, mask b) {
    return (mask){_mm256_andnot_ps(a.all, b.all)};
}

static inline bool any(mask a) {
    return !_mm256_testz_ps(a.all, a.all);
}

static inline int count_of(mask a) {
    return __builtin_popcount((unsigned)_mm256_movemask_ps(a.all));
}

static inline bool bit_of(mask a, int lane) {
    return _mm256_movemask_ps(a.all) >> lane & 1;
}

static inline num choose(mask m, num yes, num no) {
    return _mm256_blendv_ps(no, yes, m.all);
}

static inline num look_up(const float *table, num at) {
    return _mm256_i32gather_ps(table, _mm256_cvtps_epi32(at), 4);
}

static inline mask bit_set(num a, int k) {
    const __m256i bit = _mm256_set1_epi32(1 << k);
    return (mask){
        _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_cvtps_epi32(a), bit), bit))};
}

static inline void unload_wide(num a, double scale, double to[LANES]) {
    const __m256d by = _mm256_set1_pd(scale);
    _mm256_storeu_pd(to, _mm256_cvtps_pd(_mm256_castps256_ps128(a)) * by);
    _mm256_storeu_pd(to + 4, _mm256_cvtps_pd(_mm256_extractf128_ps(a, 1)) * by);
}

static inline mask positive(num a) {
    return less(set(0), a);
}

static inline mask first_lanes(int count) {
    return less(ramp(), set((float)count));
}

static inline void unload(num a, double scale, float to[LANES]) {
    _mm256_storeu_ps(to, a * set((float)scale));
}

#endif
