// Eight lanes of floats: AVX2 and FMA. Included by lanes.h.
#ifndef FIXED_LANES8_H
#define FIXED_LANES8_H

#include <immintrin.h>

typedef __m256 vnum;
typedef struct {
    __m256 all; // all bits of a lane, or none
} vmask;

static inline vnum v_splat(float a) {
    return _mm256_set1_ps(a);
}

static inline vnum v_iota(void) {
    return _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
}

static inline vnum v_load(const float from[LANES]) {
    return _mm256_loadu_ps(from);
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
    return _mm256_fmadd_ps(a, b, c);
}

static inline vnum v_sqrt_of(vnum a) {
    return _mm256_sqrt_ps(a);
}

static inline vmask v_cmp_lt(vnum a, vnum b) {
    return (vmask){_mm256_cmp_ps(a, b, _CMP_LT_OQ)};
}

static inline vmask v_and(vmask a, vmask b) {
    return (vmask){_mm256_and_ps(a.all, b.all)};
}

static inline vmask v_or(vmask a, vmask b) {
    return (vmask){_mm256_or_ps(a.all, b.all)};
}

static inline vmask v_andnot(vmask a, vmask b) {
    return (vmask){_mm256_andnot_ps(a.all, b.all)};
}

static inline bool v_any(vmask a) {
    return !_mm256_testz_ps(a.all, a.all);
}

static inline int v_count(vmask a) {
    return __builtin_popcount((unsigned)_mm256_movemask_ps(a.all));
}

static inline bool v_mask_lane(vmask a, int lane) {
    return _mm256_movemask_ps(a.all) >> lane & 1;
}

static inline vnum v_select(vmask m, vnum yes, vnum no) {
    return _mm256_blendv_ps(no, yes, m.all);
}

static inline vnum v_gather(const float *table, vnum at) {
    return _mm256_i32gather_ps(table, _mm256_cvtps_epi32(at), 4);
}

static inline vmask v_test_bit(vnum a, int k) {
    const __m256i bit = _mm256_set1_epi32(1 << k);
    return (vmask){
        _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_cvtps_epi32(a), bit), bit))};
}

static inline void v_store_double(vnum a, double scale, double to[LANES]) {
    const __m256d by = _mm256_set1_pd(scale);
    _mm256_storeu_pd(to, _mm256_cvtps_pd(_mm256_castps256_ps128(a)) * by);
    _mm256_storeu_pd(to + 4, _mm256_cvtps_pd(_mm256_extractf128_ps(a, 1)) * by);
}

static inline vmask v_positive(vnum a) {
    return v_cmp_lt(v_splat(0), a);
}

static inline vmask v_mask_first(int count) {
    return v_cmp_lt(v_iota(), v_splat((float)count));
}

static inline void v_store_float(vnum a, double scale, float to[LANES]) {
    _mm256_storeu_ps(to, a * v_splat((float)scale));
}

#endif
