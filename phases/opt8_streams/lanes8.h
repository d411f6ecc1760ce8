// Eight lanes: AVX2 and FMA. See lanes.h.
#ifndef OPT6_LANES8_H
#define OPT6_LANES8_H

typedef __m256 real;
typedef __m256d half; // doubles of half of the lanes
typedef struct {
    __m256 all; // all bits of a lane set, or none
} mask;

static inline real set(float a) {
    return _mm256_set1_ps(a);
}

static inline real load(const float from[LANES]) {
    return _mm256_loadu_ps(from);
}

static inline void unload(real a, float to[LANES]) {
    _mm256_storeu_ps(to, a);
}

static inline float first_of(real a) {
    return _mm256_cvtss_f32(a);
}

static inline mask less(real a, real b) {
    return (mask){_mm256_cmp_ps(a, b, _CMP_LT_OQ)};
}

static inline mask greater(real a, real b) {
    return (mask){_mm256_cmp_ps(a, b, _CMP_GT_OQ)};
}

static inline mask not_less(real a, real b) {
    return (mask){_mm256_cmp_ps(a, b, _CMP_GE_OQ)};
}

static inline mask below(real a, real b) {
    return (mask){_mm256_cmp_ps(a, b, _CMP_NGE_UQ)};
}

static inline mask negative(real a) {
    return (mask){_mm256_castsi256_ps(_mm256_srai_epi32(_mm256_castps_si256(a), 31))};
}

static inline mask no_lane(void) {
    return (mask){_mm256_setzero_ps()};
}

static inline mask all_lanes(void) {
    return (mask){_mm256_castsi256_ps(_mm256_set1_epi32(-1))};
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

static inline unsigned bits(mask a) {
    return (unsigned)_mm256_movemask_ps(a.all);
}

// The other way round from bits().
static inline mask lanes_of(unsigned which) {
    const __m256i one = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    __m256i its = _mm256_and_si256(_mm256_set1_epi32((int)which), one);
    return (mask){_mm256_castsi256_ps(_mm256_cmpeq_epi32(its, one))};
}

static inline bool any(mask a) {
    return bits(a) != 0;
}

static inline bool all(mask a) {
    return bits(a) == 0xff;
}

static inline bool same(mask a, mask b) {
    return bits(a) == bits(b);
}

static inline real choose(mask m, real yes, real no) {
    return _mm256_blendv_ps(no, yes, m.all);
}

static inline real keep(mask m, real a) {
    return _mm256_and_ps(m.all, a);
}

static inline real drop(mask m, real a) {
    return _mm256_andnot_ps(m.all, a);
}

static inline real negate_where(mask m, real a) {
    return _mm256_xor_ps(a, _mm256_and_ps(m.all, set(-0.0f)));
}

static inline real add_where(mask m, real a, real b) {
    return a + keep(m, b);
}

static inline mask less_in(mask m, real a, real b) {
    return both(m, less(a, b));
}

static inline mask not_less_in(mask m, real a, real b) {
    return but_not(less(a, b), m);
}

static inline mask not_greater_in(mask m, real a, real b) {
    return but_not(greater(a, b), m);
}

static inline real least_of(real a, real b) {
    return _mm256_min_ps(a, b);
}

static inline real most_of(real a, real b) {
    return _mm256_max_ps(a, b);
}

static inline float least_lane(real a) {
    __m128 b = _mm_min_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    b = _mm_min_ps(b, _mm_movehl_ps(b, b));
    return _mm_cvtss_f32(_mm_min_ss(b, _mm_movehdup_ps(b)));
}

static inline real absolute(real a) {
    return _mm256_andnot_ps(set(-0.0f), a);
}

static inline real with_sign_of(real from, real a) {
    return _mm256_or_ps(_mm256_and_ps(set(-0.0f), from), absolute(a));
}

static inline real root(real a) {
    return _mm256_sqrt_ps(a);
}

static inline real root_below(real a) {
    return a * _mm256_rsqrt_ps(a) * set(1.0f - 0x1p-11f);
}

// 1/√a to 11 bits, for normal a > 0.
static inline real root_guess(real a) {
    COUNT(root_guess, call);
    return _mm256_rsqrt_ps(a);
}

// a·b + c in the lanes of m, a in the others.
static inline real mul_add_where(mask m, real a, real b, real c) {
    return _mm256_blendv_ps(a, _mm256_fmadd_ps(a, b, c), m.all);
}

static inline mask but_greater(mask m, real a, real b) {
    return (mask){_mm256_and_ps(m.all, _mm256_cmp_ps(a, b, _CMP_NGT_UQ))};
}

static inline mask but_not_less(mask m, real a, real b) {
    return (mask){_mm256_and_ps(m.all, _mm256_cmp_ps(a, b, _CMP_NGE_UQ))};
}

// 1/√a and 1/a to 14 bits and better, for normal a > 0: 12 bits and once Newton's step.
static inline real rough_inverse_root(real a) {
    COUNT(rough_inverse_root, call);
    real r = _mm256_rsqrt_ps(a);
    return r * _mm256_fnmadd_ps(a * r, r * set(0.5f), set(1.5f));
}

static inline real rough_inverse(real a) {
    COUNT(rough_inverse, call);
    real r = _mm256_rcp_ps(a);
    return r * _mm256_fnmadd_ps(a, r, set(2.0f));
}

// scale·√a for normal a > 0, to a few ulp, and two factors of 1/a, whose product may be below what is normal.
static inline real root_and_inverse(real a, float scale, real *one, real *other) {
    COUNT(root_and_inverse, call);
    COUNT(root_and_inverse, eight);
    real r = rough_inverse_root(a);
    *one = *other = r;
    return (a * r) * set(scale);
}

// a = mantissa·2^exponent, 3/4 ≤ mantissa < 3/2.
static inline real mantissa_near_1(real a, real *exponent) {
    __m256i all = _mm256_castps_si256(a);
    __m256i steps = _mm256_srai_epi32(_mm256_sub_epi32(all, _mm256_set1_epi32(0x3f400000)), 23);
    *exponent = _mm256_cvtepi32_ps(steps);
    return _mm256_castsi256_ps(_mm256_sub_epi32(all, _mm256_slli_epi32(steps, 23)));
}

static inline real floor_of(real a) {
    return _mm256_floor_ps(a);
}

static inline real whole_near(real a) {
    return _mm256_round_ps(a, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
}

static inline real mul_add(real a, real b, real c) {
    return _mm256_fmadd_ps(a, b, c);
}

static inline real neg_mul_add(real a, real b, real c) {
    return _mm256_fnmadd_ps(a, b, c);
}

static inline real mul_sub(real a, real b, real c) {
    return _mm256_fmsub_ps(a, b, c);
}

static inline real exponent_of(real a) {
    __m256i field = _mm256_srli_epi32(_mm256_castps_si256(a), 23);
    return _mm256_cvtepi32_ps(_mm256_sub_epi32(field, _mm256_set1_epi32(127)));
}

static inline real mantissa_of(real a) {
    __m256i fraction = _mm256_and_si256(_mm256_castps_si256(a), _mm256_set1_epi32(0x007fffff));
    return _mm256_castsi256_ps(_mm256_or_si256(fraction, _mm256_set1_epi32(0x3f800000)));
}

static inline real scaled(real a, real n) {
    __m256i power = _mm256_slli_epi32(_mm256_cvtps_epi32(n), 23);
    return _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(a), power));
}

static inline half half_set(double a) {
    return _mm256_set1_pd(a);
}

static inline half half_mul_add(half a, half b, half c) {
    return _mm256_fmadd_pd(a, b, c);
}

static inline half half_neg_mul_add(half a, half b, half c) {
    return _mm256_fnmadd_pd(a, b, c);
}

// 1/√a to 11 bits.
static inline half half_rough_inverse_root(half a) {
    return _mm256_cvtps_pd(_mm_rsqrt_ps(_mm256_cvtpd_ps(a)));
}

static inline half half_root(half a) {
    return _mm256_sqrt_pd(a);
}

static inline half half_floor(half a) {
    return _mm256_floor_pd(a);
}

static inline half half_low(real a) {
    return _mm256_cvtps_pd(_mm256_castps256_ps128(a));
}

static inline half half_high(real a) {
    return _mm256_cvtps_pd(_mm256_extractf128_ps(a, 1));
}

static inline real narrowed(half low, half high) {
    return _mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low));
}

// Of many rows: which lanes go first is told once; by a table, for no branch foresees where a loop over bits ends.
typedef __m256i packing;

#define PACK_LANE(m, lane)                                                                         \
    ((m) >> (lane) & 1 ? (lane##ull) << 8 * __builtin_popcount((m) & ((1u << (lane)) - 1)) : 0)
#define PACK_1(m)                                                                                  \
    (PACK_LANE(m, 0) | PACK_LANE(m, 1) | PACK_LANE(m, 2) | PACK_LANE(m, 3) | PACK_LANE(m, 4) |     \
     PACK_LANE(m, 5) | PACK_LANE(m, 6) | PACK_LANE(m, 7))
#define PACK_4(m) PACK_1(m), PACK_1((m) + 1), PACK_1((m) + 2), PACK_1((m) + 3)
#define PACK_16(m) PACK_4(m), PACK_4((m) + 4), PACK_4((m) + 8), PACK_4((m) + 12)
#define PACK_64(m) PACK_16(m), PACK_16((m) + 16), PACK_16((m) + 32), PACK_16((m) + 48)

static inline packing packing_of(mask m) {
    static const unsigned long long lanes[256] = {PACK_64(0), PACK_64(64), PACK_64(128),
                                                  PACK_64(192)};
    return _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)&lanes[bits(m)]));
}

static inline void pack_by(packing p, real a, float to[LANES]) {
    _mm256_storeu_ps(to, _mm256_permutevar8x32_ps(a, p));
}

// The lanes of m in a row, from `to` on: LANES floats are written.
static inline void pack(mask m, real a, float to[LANES]) {
    pack_by(packing_of(m), a, to);
}

// The other way round, for many: floats in rows `stride` apart into the lanes of each of `to`.
static inline void expand_rows(real *to, int count, unsigned lanes, const float *from, int stride) {
    for (; lanes; lanes &= lanes - 1, from++) {
        float *lane = (float *)to + __builtin_ctz(lanes);
        for (int i = 0; i < count; i++)
            lane[i * LANES] = from[(size_t)i * (size_t)stride];
    }
}

static inline real fill(mask m, real a, const float *from) {
    float lanes[LANES];
    unload(a, lanes);
    for (unsigned rest = bits(m); rest; rest &= rest - 1)
        lanes[__builtin_ctz(rest)] = *from++;
    return load(lanes);
}

// Red, green and blue of a block of 4 x 2 pixels, each row 12 floats `stride` apart.
static inline void store_block(float *rgb, size_t stride, real r, real g, real b) {
    float lanes[3][LANES];
    unload(r, lanes[0]);
    unload(g, lanes[1]);
    unload(b, lanes[2]);
    for (int lane = 0; lane < LANES; lane++)
        for (int i = 0; i < 3; i++)
            rgb[(size_t)(lane / 4) * stride + (size_t)(3 * (lane % 4) + i)] = lanes[i][lane];
}

#endif
