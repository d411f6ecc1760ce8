// Sixteen lanes: AVX-512 F and DQ. See lanes.h.
#ifndef PACKETS_LANES16_H
#define PACKETS_LANES16_H

typedef __m512 real;
typedef struct {
    __mmask16 all; // a bit for each lane
} mask;

static inline real set(float a) {
    return _mm512_set1_ps(a);
}

static inline real load(const float from[LANES]) {
    return _mm512_loadu_ps(from);
}

static inline void unload(real a, float to[LANES]) {
    _mm512_storeu_ps(to, a);
}

static inline float first_of(real a) {
    return _mm512_cvtss_f32(a);
}

static inline real lane_numbers(void) {
    return _mm512_setr_ps(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}

static inline mask less(real a, real b) {
    return (mask){_mm512_cmp_ps_mask(a, b, _CMP_LT_OQ)};
}

static inline mask greater(real a, real b) {
    return (mask){_mm512_cmp_ps_mask(a, b, _CMP_GT_OQ)};
}

static inline mask not_less(real a, real b) {
    return (mask){_mm512_cmp_ps_mask(a, b, _CMP_GE_OQ)};
}

static inline mask equal(real a, real b) {
    return (mask){_mm512_cmp_ps_mask(a, b, _CMP_EQ_OQ)};
}

static inline mask no_lane(void) {
    return (mask){0};
}

static inline mask lanes_of(unsigned which) {
    return (mask){(__mmask16)which};
}

static inline mask both(mask a, mask b) {
    return (mask){a.all & b.all};
}

static inline mask either(mask a, mask b) {
    return (mask){a.all | b.all};
}

static inline mask but_not(mask a, mask b) {
    return (mask){_kandn_mask16(a.all, b.all)};
}

static inline unsigned bits(mask a) {
    return a.all;
}

static inline real choose(mask m, real yes, real no) {
    return _mm512_mask_blend_ps(m.all, no, yes);
}

static inline real keep(mask m, real a) {
    return _mm512_maskz_mov_ps(m.all, a);
}

static inline real negate_where(mask m, real a) {
    return _mm512_mask_xor_ps(a, m.all, a, set(-0.0f));
}

static inline real least_of(real a, real b) {
    return _mm512_min_ps(a, b);
}

static inline real most_of(real a, real b) {
    return _mm512_max_ps(a, b);
}

static inline float least_lane(real a) {
    COUNT(least_lane, call);
    return _mm512_reduce_min_ps(a);
}

static inline float most_lane(real a) {
    COUNT(most_lane, call);
    return _mm512_reduce_max_ps(a);
}

static inline real absolute(real a) {
    return _mm512_andnot_ps(set(-0.0f), a);
}

static inline real with_sign_of(real from, real a) {
    return _mm512_or_ps(_mm512_and_ps(set(-0.0f), from), absolute(a));
}

static inline real root(real a) {
    return _mm512_sqrt_ps(a);
}

static inline real mul_add(real a, real b, real c) {
    return _mm512_fmadd_ps(a, b, c);
}

static inline real neg_mul_add(real a, real b, real c) {
    return _mm512_fnmadd_ps(a, b, c);
}

static inline real mul_sub(real a, real b, real c) {
    return _mm512_fmsub_ps(a, b, c);
}

static inline real newton_inverse_root(real a) {
    real r = _mm512_rsqrt14_ps(a);
    return r * neg_mul_add(a * r, r * set(0.5f), set(1.5f));
}

static inline real whole_near(real a) {
    return _mm512_roundscale_ps(a, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
}

static inline real exponent_of(real a) {
    __m512i field = _mm512_srli_epi32(_mm512_castps_si512(a), 23);
    return _mm512_cvtepi32_ps(_mm512_sub_epi32(field, _mm512_set1_epi32(127)));
}

static inline real mantissa_of(real a) {
    __m512i fraction = _mm512_and_si512(_mm512_castps_si512(a), _mm512_set1_epi32(0x007fffff));
    return _mm512_castsi512_ps(_mm512_or_si512(fraction, _mm512_set1_epi32(0x3f800000)));
}

static inline real scaled(real a, real n) {
    __m512i power = _mm512_slli_epi32(_mm512_cvtps_epi32(n), 23);
    return _mm512_castsi512_ps(_mm512_add_epi32(_mm512_castps_si512(a), power));
}

static inline void pack(mask m, real a, float to[LANES]) {
    _mm512_storeu_ps(to, _mm512_maskz_compress_ps(m.all, a));
}

#endif
