// Four lanes: SSE2, which every x86-64 has. See simd.h. Multiply-adds are rounded twice: SSE2 has no fused ones.
#pragma once

typedef __m128 vfloat;
typedef struct {
    __m128 bits; // all bits of a lane set, or none
} vmask;

static inline vfloat v_splat(float a) {
    return _mm_set1_ps(a);
}

static inline vfloat v_load(const float from[LANES]) {
    return _mm_loadu_ps(from);
}

static inline void v_store(vfloat a, float to[LANES]) {
    _mm_storeu_ps(to, a);
}

static inline float v_lane0(vfloat a) {
    return _mm_cvtss_f32(a);
}

static inline vfloat v_iota(void) {
    return _mm_setr_ps(0, 1, 2, 3);
}

static inline vmask v_cmp_eq(vfloat a, vfloat b) {
    return (vmask){_mm_cmpeq_ps(a, b)};
}

static inline vmask v_cmp_lt(vfloat a, vfloat b) {
    return (vmask){_mm_cmplt_ps(a, b)};
}

static inline vmask v_cmp_le(vfloat a, vfloat b) {
    return (vmask){_mm_cmple_ps(a, b)};
}

static inline vmask v_cmp_gt(vfloat a, vfloat b) {
    return (vmask){_mm_cmpgt_ps(a, b)};
}

static inline vmask v_cmp_ge(vfloat a, vfloat b) {
    return (vmask){_mm_cmpge_ps(a, b)};
}

static inline vmask v_cmp_nlt(vfloat a, vfloat b) {
    return (vmask){_mm_cmpnlt_ps(a, b)};
}

static inline vmask v_cmp_ngt(vfloat a, vfloat b) {
    return (vmask){_mm_cmpngt_ps(a, b)};
}

static inline vmask v_cmp_nge(vfloat a, vfloat b) {
    return (vmask){_mm_cmpnge_ps(a, b)};
}

static inline vmask v_signbit(vfloat a) {
    return (vmask){_mm_castsi128_ps(_mm_srai_epi32(_mm_castps_si128(a), 31))};
}

static inline vmask v_mask_none(void) {
    return (vmask){_mm_setzero_ps()};
}

static inline vmask v_mask_all(void) {
    return (vmask){_mm_castsi128_ps(_mm_set1_epi32(-1))};
}

static inline vmask v_mask_of_bits(unsigned which) {
    const __m128i one = _mm_setr_epi32(1, 2, 4, 8);
    __m128i its = _mm_and_si128(_mm_set1_epi32((int)which), one);
    return (vmask){_mm_castsi128_ps(_mm_cmpeq_epi32(its, one))};
}

static inline unsigned v_mask_bits(vmask a) {
    return (unsigned)_mm_movemask_ps(a.bits);
}

static inline vmask v_and(vmask a, vmask b) {
    return (vmask){_mm_and_ps(a.bits, b.bits)};
}

static inline vmask v_or(vmask a, vmask b) {
    return (vmask){_mm_or_ps(a.bits, b.bits)};
}

static inline vmask v_andnot(vmask a, vmask b) {
    return (vmask){_mm_andnot_ps(a.bits, b.bits)};
}

static inline vfloat v_select(vmask m, vfloat yes, vfloat no) {
    return _mm_or_ps(_mm_and_ps(m.bits, yes), _mm_andnot_ps(m.bits, no));
}

static inline vfloat v_select_or_zero(vmask m, vfloat a) {
    return _mm_and_ps(m.bits, a);
}

static inline vfloat v_zero_where(vmask m, vfloat a) {
    return _mm_andnot_ps(m.bits, a);
}

static inline vfloat v_negate_where(vmask m, vfloat a) {
    return _mm_xor_ps(a, _mm_and_ps(m.bits, v_splat(-0.0f)));
}

static inline vfloat v_add_where(vmask m, vfloat a, vfloat b) {
    return a + v_select_or_zero(m, b);
}

static inline vfloat v_madd_where(vmask m, vfloat a, vfloat b, vfloat c) {
    return v_select(m, a * b + c, a);
}

static inline vfloat v_min(vfloat a, vfloat b) {
    return _mm_min_ps(a, b);
}

static inline vfloat v_max(vfloat a, vfloat b) {
    return _mm_max_ps(a, b);
}

static inline float v_reduce_min(vfloat a) {
    a = _mm_min_ps(a, _mm_movehl_ps(a, a));
    return _mm_cvtss_f32(_mm_min_ss(a, _mm_shuffle_ps(a, a, 1)));
}

static inline float v_reduce_max(vfloat a) {
    a = _mm_max_ps(a, _mm_movehl_ps(a, a));
    return _mm_cvtss_f32(_mm_max_ss(a, _mm_shuffle_ps(a, a, 1)));
}

static inline vfloat v_max_of_lanes(vfloat a) {
    a = v_max(a, _mm_shuffle_ps(a, a, 0x4e));
    return v_max(a, _mm_shuffle_ps(a, a, 0xb1));
}

static inline vfloat v_abs(vfloat a) {
    return _mm_andnot_ps(v_splat(-0.0f), a);
}

static inline vfloat v_copysign(vfloat a, vfloat from) {
    return _mm_or_ps(_mm_and_ps(v_splat(-0.0f), from), v_abs(a));
}

static inline vfloat v_sqrt(vfloat a) {
    return _mm_sqrt_ps(a);
}

static inline vfloat v_rsqrt_approx(vfloat a) {
    return _mm_rsqrt_ps(a);
}

static inline vfloat v_rcp_approx(vfloat a) {
    return _mm_rcp_ps(a);
}

// Of |a| < 2^31: SSE2 rounds by way of whole numbers.
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

static inline vfloat v_exponent(vfloat a) {
    __m128i field = _mm_srli_epi32(_mm_castps_si128(a), 23);
    return _mm_cvtepi32_ps(_mm_sub_epi32(field, _mm_set1_epi32(127)));
}

static inline vfloat v_mantissa(vfloat a) {
    __m128i fraction = _mm_and_si128(_mm_castps_si128(a), _mm_set1_epi32(0x007fffff));
    return _mm_castsi128_ps(_mm_or_si128(fraction, _mm_set1_epi32(0x3f800000)));
}

static inline vfloat v_mantissa_near_1(vfloat a, vfloat *exponent) {
    __m128i all = _mm_castps_si128(a);
    __m128i steps = _mm_srai_epi32(_mm_sub_epi32(all, _mm_set1_epi32(0x3f400000)), 23);
    *exponent = _mm_cvtepi32_ps(steps);
    return _mm_castsi128_ps(_mm_sub_epi32(all, _mm_slli_epi32(steps, 23)));
}

static inline vfloat v_ldexp(vfloat a, vfloat n) {
    __m128i power = _mm_slli_epi32(_mm_cvtps_epi32(n), 23);
    return _mm_castsi128_ps(_mm_add_epi32(_mm_castps_si128(a), power));
}

static inline vfloat v_pow2_unit(vfloat a) {
    __m128i field = _mm_and_si128(_mm_castps_si128(a), _mm_set1_epi32(0x7f800000));
    return _mm_castsi128_ps(_mm_sub_epi32(_mm_set1_epi32(0x7f000000), field));
}

static inline void v_compress_store(vmask m, vfloat a, float to[LANES]) {
    float lanes[LANES];
    v_store(a, lanes);
    for (unsigned rest = v_mask_bits(m); rest; rest &= rest - 1)
        *to++ = lanes[__builtin_ctz(rest)];
}
