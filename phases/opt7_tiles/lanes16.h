// Sixteen lanes: AVX-512 F and DQ. See lanes.h.
#ifndef OPT6_LANES16_H
#define OPT6_LANES16_H

typedef __m512 real;
typedef __m512d half; // doubles of half of the lanes
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

static inline mask less(real a, real b) {
    return (mask){_mm512_cmp_ps_mask(a, b, _CMP_LT_OQ)};
}

static inline mask greater(real a, real b) {
    return (mask){_mm512_cmp_ps_mask(a, b, _CMP_GT_OQ)};
}

static inline mask not_less(real a, real b) {
    return (mask){_mm512_cmp_ps_mask(a, b, _CMP_GE_OQ)};
}

static inline mask below(real a, real b) {
    return (mask){_mm512_cmp_ps_mask(a, b, _CMP_NGE_UQ)};
}

static inline mask negative(real a) {
    return (mask){_mm512_movepi32_mask(_mm512_castps_si512(a))};
}

static inline mask no_lane(void) {
    return (mask){0};
}

static inline mask all_lanes(void) {
    return (mask){0xffff};
}

static inline mask both(mask a, mask b) {
    return (mask){_kand_mask16(a.all, b.all)};
}

static inline mask either(mask a, mask b) {
    return (mask){_kor_mask16(a.all, b.all)};
}

static inline mask but_not(mask a, mask b) {
    return (mask){_kandn_mask16(a.all, b.all)};
}

static inline unsigned bits(mask a) {
    return _cvtmask16_u32(a.all);
}

static inline bool any(mask a) {
    return !_kortestz_mask16_u8(a.all, a.all);
}

static inline bool all(mask a) {
    return _kortestc_mask16_u8(a.all, a.all);
}

static inline bool same(mask a, mask b) {
    return bits(a) == bits(b);
}

static inline real choose(mask m, real yes, real no) {
    return _mm512_mask_blend_ps(m.all, no, yes);
}

static inline real keep(mask m, real a) {
    return _mm512_maskz_mov_ps(m.all, a);
}

static inline real drop(mask m, real a) {
    return _mm512_maskz_mov_ps(_knot_mask16(m.all), a);
}

static inline real negate_where(mask m, real a) {
    return _mm512_mask_xor_ps(a, m.all, a, set(-0.0f));
}

static inline real add_where(mask m, real a, real b) {
    return _mm512_mask_add_ps(a, m.all, a, b);
}

static inline mask less_in(mask m, real a, real b) {
    return (mask){_mm512_mask_cmp_ps_mask(m.all, a, b, _CMP_LT_OQ)};
}

static inline mask not_less_in(mask m, real a, real b) {
    return (mask){_mm512_mask_cmp_ps_mask(m.all, a, b, _CMP_NLT_UQ)};
}

static inline mask not_greater_in(mask m, real a, real b) {
    return (mask){_mm512_mask_cmp_ps_mask(m.all, a, b, _CMP_NGT_UQ)};
}

static inline real least_of(real a, real b) {
    return _mm512_min_ps(a, b);
}

static inline real most_of(real a, real b) {
    return _mm512_max_ps(a, b);
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

static inline real root_below(real a) {
    return a * _mm512_rsqrt14_ps(a) * set(1.0f - 0x1p-13f);
}

static inline real floor_of(real a) {
    return _mm512_floor_ps(a);
}

static inline real whole_near(real a) {
    return _mm512_roundscale_ps(a, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
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

static inline half half_set(double a) {
    return _mm512_set1_pd(a);
}

static inline half half_mul_add(half a, half b, half c) {
    return _mm512_fmadd_pd(a, b, c);
}

static inline half half_floor(half a) {
    return _mm512_floor_pd(a);
}

static inline half half_low(real a) {
    return _mm512_cvtps_pd(_mm512_castps512_ps256(a));
}

static inline half half_high(real a) {
    return _mm512_cvtps_pd(_mm512_extractf32x8_ps(a, 1));
}

static inline real narrowed(half low, half high) {
    return _mm512_insertf32x8(_mm512_castps256_ps512(_mm512_cvtpd_ps(low)), _mm512_cvtpd_ps(high),
                              1);
}

// Of several rows: which lanes go first is told once.
typedef __m512i packing;

static inline packing packing_of(mask m) {
    return _mm512_maskz_compress_epi32(
        m.all, _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
}

// The lanes of m in a row, from `to` on: LANES floats are written.
static inline void pack_by(packing p, real a, float to[LANES]) {
    _mm512_storeu_ps(to, _mm512_permutexvar_ps(p, a));
}

// a, but for the lanes of m, which get what is in a row from `from` on.
static inline real fill(mask m, real a, const float *from) {
    return _mm512_mask_expandloadu_ps(a, m.all, from);
}

// Red, green and blue of a block of 4 x 4 pixels, each row 12 floats `stride` apart.
static inline void store_block(float *rgb, size_t stride, real r, real g, real b) {
    const __m512i rg = _mm512_setr_epi32(0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 0, 0, 0, 0);
    const __m512i to_b = _mm512_setr_epi32(0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 0, 0, 0, 0);
    for (int row = 0; row < 4; row++) {
        __m512i from = _mm512_set1_epi32(4 * row);
        __m512 two = _mm512_permutex2var_ps(r, _mm512_add_epi32(rg, from), g);
        __m512i blue = _mm512_mask_add_epi32(to_b, 0x924, to_b, from);
        _mm512_mask_storeu_ps(rgb + (size_t)row * stride, 0xfff,
                              _mm512_permutex2var_ps(two, blue, b));
    }
}

#endif
