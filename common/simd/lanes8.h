// Eight lanes: AVX2 and FMA. See simd.h.
#pragma once

typedef __m256 vfloat;
typedef __m256d vhalf; // doubles for half of the lanes
typedef struct {
    __m256 bits; // all bits of a lane set, or none
} vmask;

static inline vfloat v_splat(float a) {
    return _mm256_set1_ps(a);
}

static inline vfloat v_load(const float from[LANES]) {
    return _mm256_loadu_ps(from);
}

static inline void v_store(vfloat a, float to[LANES]) {
    _mm256_storeu_ps(to, a);
}

static inline float v_lane0(vfloat a) {
    return _mm256_cvtss_f32(a);
}

static inline vfloat v_iota(void) {
    return _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
}

static inline vmask v_cmp_eq(vfloat a, vfloat b) {
    return (vmask){_mm256_cmp_ps(a, b, _CMP_EQ_OQ)};
}

static inline vmask v_cmp_lt(vfloat a, vfloat b) {
    return (vmask){_mm256_cmp_ps(a, b, _CMP_LT_OQ)};
}

static inline vmask v_cmp_le(vfloat a, vfloat b) {
    return (vmask){_mm256_cmp_ps(a, b, _CMP_LE_OQ)};
}

static inline vmask v_cmp_gt(vfloat a, vfloat b) {
    return (vmask){_mm256_cmp_ps(a, b, _CMP_GT_OQ)};
}

static inline vmask v_cmp_ge(vfloat a, vfloat b) {
    return (vmask){_mm256_cmp_ps(a, b, _CMP_GE_OQ)};
}

static inline vmask v_cmp_nlt(vfloat a, vfloat b) {
    return (vmask){_mm256_cmp_ps(a, b, _CMP_NLT_UQ)};
}

static inline vmask v_cmp_ngt(vfloat a, vfloat b) {
    return (vmask){_mm256_cmp_ps(a, b, _CMP_NGT_UQ)};
}

static inline vmask v_cmp_nge(vfloat a, vfloat b) {
    return (vmask){_mm256_cmp_ps(a, b, _CMP_NGE_UQ)};
}

static inline vmask v_signbit(vfloat a) {
    return (vmask){_mm256_castsi256_ps(_mm256_srai_epi32(_mm256_castps_si256(a), 31))};
}

static inline vmask v_mask_none(void) {
    return (vmask){_mm256_setzero_ps()};
}

static inline vmask v_mask_all(void) {
    return (vmask){_mm256_castsi256_ps(_mm256_set1_epi32(-1))};
}

static inline vmask v_mask_of_bits(unsigned which) {
    const __m256i one = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    __m256i its = _mm256_and_si256(_mm256_set1_epi32((int)which), one);
    return (vmask){_mm256_castsi256_ps(_mm256_cmpeq_epi32(its, one))};
}

static inline unsigned v_mask_bits(vmask a) {
    return (unsigned)_mm256_movemask_ps(a.bits);
}

static inline unsigned v_any_of_four(vmask a, vmask b, vmask c, vmask d) {
    __m256i ab = _mm256_packs_epi32(_mm256_castps_si256(a.bits), _mm256_castps_si256(b.bits));
    __m256i cd = _mm256_packs_epi32(_mm256_castps_si256(c.bits), _mm256_castps_si256(d.bits));
    __m256i none = _mm256_cmpeq_epi32(_mm256_packs_epi16(ab, cd), _mm256_setzero_si256());
    unsigned of_half = (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(none));
    return ~(of_half & of_half >> 4) & 15;
}

static inline vmask v_and(vmask a, vmask b) {
    return (vmask){_mm256_and_ps(a.bits, b.bits)};
}

static inline vmask v_or(vmask a, vmask b) {
    return (vmask){_mm256_or_ps(a.bits, b.bits)};
}

static inline vmask v_andnot(vmask a, vmask b) {
    return (vmask){_mm256_andnot_ps(a.bits, b.bits)};
}

static inline vfloat v_select(vmask m, vfloat yes, vfloat no) {
    return _mm256_blendv_ps(no, yes, m.bits);
}

static inline vfloat v_select_or_zero(vmask m, vfloat a) {
    return _mm256_and_ps(m.bits, a);
}

static inline vfloat v_zero_where(vmask m, vfloat a) {
    return _mm256_andnot_ps(m.bits, a);
}

static inline vfloat v_negate_where(vmask m, vfloat a) {
    return _mm256_xor_ps(a, _mm256_and_ps(m.bits, v_splat(-0.0f)));
}

static inline vfloat v_add_where(vmask m, vfloat a, vfloat b) {
    return a + v_select_or_zero(m, b);
}

static inline vfloat v_madd_where(vmask m, vfloat a, vfloat b, vfloat c) {
    return _mm256_blendv_ps(a, _mm256_fmadd_ps(a, b, c), m.bits);
}

static inline vfloat v_min(vfloat a, vfloat b) {
    return _mm256_min_ps(a, b);
}

static inline vfloat v_max(vfloat a, vfloat b) {
    return _mm256_max_ps(a, b);
}

static inline float v_reduce_min(vfloat a) {
    __m128 b = _mm_min_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    b = _mm_min_ps(b, _mm_movehl_ps(b, b));
    return _mm_cvtss_f32(_mm_min_ss(b, _mm_movehdup_ps(b)));
}

static inline float v_reduce_max(vfloat a) {
    __m128 b = _mm_max_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    b = _mm_max_ps(b, _mm_movehl_ps(b, b));
    return _mm_cvtss_f32(_mm_max_ss(b, _mm_movehdup_ps(b)));
}

static inline vfloat v_max_of_lanes(vfloat a) {
    a = v_max(a, _mm256_permute2f128_ps(a, a, 1));
    a = v_max(a, _mm256_shuffle_ps(a, a, 0x4e));
    return v_max(a, _mm256_shuffle_ps(a, a, 0xb1));
}

static inline vfloat v_abs(vfloat a) {
    return _mm256_andnot_ps(v_splat(-0.0f), a);
}

static inline vfloat v_copysign(vfloat a, vfloat from) {
    return _mm256_or_ps(_mm256_and_ps(v_splat(-0.0f), from), v_abs(a));
}

static inline vfloat v_sqrt(vfloat a) {
    return _mm256_sqrt_ps(a);
}

static inline vfloat v_rsqrt_approx(vfloat a) {
    return _mm256_rsqrt_ps(a);
}

static inline vfloat v_rcp_approx(vfloat a) {
    return _mm256_rcp_ps(a);
}

static inline vfloat v_floor(vfloat a) {
    return _mm256_floor_ps(a);
}

static inline vfloat v_round(vfloat a) {
    return _mm256_round_ps(a, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
}

static inline vfloat v_madd(vfloat a, vfloat b, vfloat c) {
    return _mm256_fmadd_ps(a, b, c);
}

static inline vfloat v_nmadd(vfloat a, vfloat b, vfloat c) {
    return _mm256_fnmadd_ps(a, b, c);
}

static inline vfloat v_msub(vfloat a, vfloat b, vfloat c) {
    return _mm256_fmsub_ps(a, b, c);
}

static inline vfloat v_exponent(vfloat a) {
    __m256i field = _mm256_srli_epi32(_mm256_castps_si256(a), 23);
    return _mm256_cvtepi32_ps(_mm256_sub_epi32(field, _mm256_set1_epi32(127)));
}

static inline vfloat v_mantissa(vfloat a) {
    __m256i fraction = _mm256_and_si256(_mm256_castps_si256(a), _mm256_set1_epi32(0x007fffff));
    return _mm256_castsi256_ps(_mm256_or_si256(fraction, _mm256_set1_epi32(0x3f800000)));
}

static inline vfloat v_mantissa_near_1(vfloat a, vfloat *exponent) {
    __m256i all = _mm256_castps_si256(a);
    __m256i steps = _mm256_srai_epi32(_mm256_sub_epi32(all, _mm256_set1_epi32(0x3f400000)), 23);
    *exponent = _mm256_cvtepi32_ps(steps);
    return _mm256_castsi256_ps(_mm256_sub_epi32(all, _mm256_slli_epi32(steps, 23)));
}

static inline vfloat v_ldexp(vfloat a, vfloat n) {
    __m256i power = _mm256_slli_epi32(_mm256_cvtps_epi32(n), 23);
    return _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(a), power));
}

static inline vfloat v_pow2_unit(vfloat a) {
    __m256i field = _mm256_and_si256(_mm256_castps_si256(a), _mm256_set1_epi32(0x7f800000));
    return _mm256_castsi256_ps(_mm256_sub_epi32(_mm256_set1_epi32(0x7f000000), field));
}

static inline vhalf v_half_splat(double a) {
    return _mm256_set1_pd(a);
}

static inline vhalf v_half_madd(vhalf a, vhalf b, vhalf c) {
    return _mm256_fmadd_pd(a, b, c);
}

static inline vhalf v_half_nmadd(vhalf a, vhalf b, vhalf c) {
    return _mm256_fnmadd_pd(a, b, c);
}

static inline vhalf v_half_rsqrt_approx(vhalf a) {
    return _mm256_cvtps_pd(_mm_rsqrt_ps(_mm256_cvtpd_ps(a)));
}

static inline vhalf v_half_sqrt(vhalf a) {
    return _mm256_sqrt_pd(a);
}

static inline vhalf v_half_floor(vhalf a) {
    return _mm256_floor_pd(a);
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
