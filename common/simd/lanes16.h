// Sixteen lanes: AVX-512 F and DQ. See simd.h.
#pragma once

typedef __m512 vfloat;
typedef __m512d vhalf; // doubles for half of the lanes
typedef struct {
    __mmask16 bits; // a bit for each lane
} vmask;

static inline vfloat v_splat(float a) {
    return _mm512_set1_ps(a);
}

static inline vfloat v_load(const float from[LANES]) {
    return _mm512_loadu_ps(from);
}

static inline void v_store(vfloat a, float to[LANES]) {
    _mm512_storeu_ps(to, a);
}

static inline float v_lane0(vfloat a) {
    return _mm512_cvtss_f32(a);
}

static inline vfloat v_iota(void) {
    return _mm512_setr_ps(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}

static inline vmask v_cmp_eq(vfloat a, vfloat b) {
    return (vmask){_mm512_cmp_ps_mask(a, b, _CMP_EQ_OQ)};
}

static inline vmask v_cmp_lt(vfloat a, vfloat b) {
    return (vmask){_mm512_cmp_ps_mask(a, b, _CMP_LT_OQ)};
}

static inline vmask v_cmp_le(vfloat a, vfloat b) {
    return (vmask){_mm512_cmp_ps_mask(a, b, _CMP_LE_OQ)};
}

static inline vmask v_cmp_gt(vfloat a, vfloat b) {
    return (vmask){_mm512_cmp_ps_mask(a, b, _CMP_GT_OQ)};
}

static inline vmask v_cmp_ge(vfloat a, vfloat b) {
    return (vmask){_mm512_cmp_ps_mask(a, b, _CMP_GE_OQ)};
}

static inline vmask v_cmp_nlt(vfloat a, vfloat b) {
    return (vmask){_mm512_cmp_ps_mask(a, b, _CMP_NLT_UQ)};
}

static inline vmask v_cmp_ngt(vfloat a, vfloat b) {
    return (vmask){_mm512_cmp_ps_mask(a, b, _CMP_NGT_UQ)};
}

static inline vmask v_cmp_nge(vfloat a, vfloat b) {
    return (vmask){_mm512_cmp_ps_mask(a, b, _CMP_NGE_UQ)};
}

// One instruction each, which waits for no other mask to be joined with it.
static inline vmask v_cmp_lt_in(vmask m, vfloat a, vfloat b) {
    return (vmask){_mm512_mask_cmp_ps_mask(m.bits, a, b, _CMP_LT_OQ)};
}

static inline vmask v_cmp_gt_in(vmask m, vfloat a, vfloat b) {
    return (vmask){_mm512_mask_cmp_ps_mask(m.bits, a, b, _CMP_GT_OQ)};
}

static inline vmask v_cmp_ge_in(vmask m, vfloat a, vfloat b) {
    return (vmask){_mm512_mask_cmp_ps_mask(m.bits, a, b, _CMP_GE_OQ)};
}

static inline vmask v_cmp_nlt_in(vmask m, vfloat a, vfloat b) {
    return (vmask){_mm512_mask_cmp_ps_mask(m.bits, a, b, _CMP_NLT_UQ)};
}

static inline vmask v_cmp_ngt_in(vmask m, vfloat a, vfloat b) {
    return (vmask){_mm512_mask_cmp_ps_mask(m.bits, a, b, _CMP_NGT_UQ)};
}

static inline vmask v_cmp_nge_in(vmask m, vfloat a, vfloat b) {
    return (vmask){_mm512_mask_cmp_ps_mask(m.bits, a, b, _CMP_NGE_UQ)};
}

static inline vmask v_signbit(vfloat a) {
    return (vmask){_mm512_movepi32_mask(_mm512_castps_si512(a))};
}

static inline vmask v_mask_none(void) {
    return (vmask){0};
}

static inline vmask v_mask_all(void) {
    return (vmask){0xffff};
}

static inline vmask v_mask_of_bits(unsigned which) {
    return (vmask){(__mmask16)which};
}

static inline unsigned v_mask_bits(vmask a) {
    return a.bits;
}

static inline vmask v_and(vmask a, vmask b) {
    return (vmask){a.bits & b.bits};
}

static inline vmask v_or(vmask a, vmask b) {
    return (vmask){a.bits | b.bits};
}

static inline vmask v_andnot(vmask a, vmask b) {
    return (vmask){_kandn_mask16(a.bits, b.bits)};
}

static inline vfloat v_select(vmask m, vfloat yes, vfloat no) {
    return _mm512_mask_blend_ps(m.bits, no, yes);
}

static inline vfloat v_select_or_zero(vmask m, vfloat a) {
    return _mm512_maskz_mov_ps(m.bits, a);
}

static inline vfloat v_zero_where(vmask m, vfloat a) {
    return _mm512_maskz_mov_ps(_knot_mask16(m.bits), a);
}

static inline vfloat v_negate_where(vmask m, vfloat a) {
    return _mm512_mask_xor_ps(a, m.bits, a, v_splat(-0.0f));
}

// One masked addition.
static inline vfloat v_add_where(vmask m, vfloat a, vfloat b) {
    return _mm512_mask_add_ps(a, m.bits, a, b);
}

static inline vfloat v_madd_where(vmask m, vfloat a, vfloat b, vfloat c) {
    return _mm512_mask_fmadd_ps(a, m.bits, b, c);
}

static inline vfloat v_min(vfloat a, vfloat b) {
    return _mm512_min_ps(a, b);
}

static inline vfloat v_max(vfloat a, vfloat b) {
    return _mm512_max_ps(a, b);
}

static inline float v_reduce_min(vfloat a) {
    return _mm512_reduce_min_ps(a);
}

static inline float v_reduce_max(vfloat a) {
    return _mm512_reduce_max_ps(a);
}

static inline vfloat v_max_of_lanes(vfloat a) {
    return v_splat(_mm512_reduce_max_ps(a));
}

static inline vfloat v_abs(vfloat a) {
    return _mm512_andnot_ps(v_splat(-0.0f), a);
}

static inline vfloat v_copysign(vfloat a, vfloat from) {
    return _mm512_or_ps(_mm512_and_ps(v_splat(-0.0f), from), v_abs(a));
}

static inline vfloat v_sqrt(vfloat a) {
    return _mm512_sqrt_ps(a);
}

static inline vfloat v_rsqrt_approx(vfloat a) {
    return _mm512_rsqrt14_ps(a);
}

static inline vfloat v_rcp_approx(vfloat a) {
    return _mm512_rcp14_ps(a);
}

static inline vfloat v_floor(vfloat a) {
    return _mm512_floor_ps(a);
}

static inline vfloat v_round(vfloat a) {
    return _mm512_roundscale_ps(a, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
}

static inline vfloat v_madd(vfloat a, vfloat b, vfloat c) {
    return _mm512_fmadd_ps(a, b, c);
}

static inline vfloat v_nmadd(vfloat a, vfloat b, vfloat c) {
    return _mm512_fnmadd_ps(a, b, c);
}

static inline vfloat v_msub(vfloat a, vfloat b, vfloat c) {
    return _mm512_fmsub_ps(a, b, c);
}

static inline vfloat v_exponent(vfloat a) {
    __m512i field = _mm512_srli_epi32(_mm512_castps_si512(a), 23);
    return _mm512_cvtepi32_ps(_mm512_sub_epi32(field, _mm512_set1_epi32(127)));
}

static inline vfloat v_mantissa(vfloat a) {
    __m512i fraction = _mm512_and_si512(_mm512_castps_si512(a), _mm512_set1_epi32(0x007fffff));
    return _mm512_castsi512_ps(_mm512_or_si512(fraction, _mm512_set1_epi32(0x3f800000)));
}

static inline vfloat v_mantissa_near_1(vfloat a, vfloat *exponent) {
    *exponent = _mm512_getexp_ps(a * v_splat(4.0f / 3.0f));
    return _mm512_getmant_ps(a, _MM_MANT_NORM_p75_1p5, _MM_MANT_SIGN_src);
}

static inline vfloat v_ldexp(vfloat a, vfloat n) {
    __m512i power = _mm512_slli_epi32(_mm512_cvtps_epi32(n), 23);
    return _mm512_castsi512_ps(_mm512_add_epi32(_mm512_castps_si512(a), power));
}

static inline vfloat v_pow2_unit(vfloat a) {
    __m512i field = _mm512_and_si512(_mm512_castps_si512(a), _mm512_set1_epi32(0x7f800000));
    return _mm512_castsi512_ps(_mm512_sub_epi32(_mm512_set1_epi32(0x7f000000), field));
}

static inline vhalf v_half_splat(double a) {
    return _mm512_set1_pd(a);
}

static inline vhalf v_half_madd(vhalf a, vhalf b, vhalf c) {
    return _mm512_fmadd_pd(a, b, c);
}

static inline vhalf v_half_nmadd(vhalf a, vhalf b, vhalf c) {
    return _mm512_fnmadd_pd(a, b, c);
}

static inline vhalf v_half_rsqrt_approx(vhalf a) {
    return _mm512_rsqrt14_pd(a);
}

static inline vhalf v_half_sqrt(vhalf a) {
    return _mm512_sqrt_pd(a);
}

static inline vhalf v_half_floor(vhalf a) {
    return _mm512_floor_pd(a);
}

static inline vhalf v_half_low(vfloat a) {
    return _mm512_cvtps_pd(_mm512_castps512_ps256(a));
}

static inline vhalf v_half_high(vfloat a) {
    return _mm512_cvtps_pd(_mm512_extractf32x8_ps(a, 1));
}

static inline vfloat v_from_halves(vhalf low, vhalf high) {
    return _mm512_insertf32x8(_mm512_castps256_ps512(_mm512_cvtpd_ps(low)), _mm512_cvtpd_ps(high),
                              1);
}
