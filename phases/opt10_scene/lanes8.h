// Eight lanes: AVX2 and FMA. See lanes.h.
#ifndef OPT10_LANES8_H
#define OPT10_LANES8_H

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

// past: the caches, to a place that is a multiple of a register.
static inline void put(float *to, bool past, real a) {
    if (!past)
        _mm256_storeu_ps(to, a);
    else
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__ // gcc's do not see the instruction
        *(real *)to = a;
#else
        _mm256_stream_ps(to, a);
#endif
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

// The other way round from bits().
static inline mask lanes_of(unsigned which) {
    const __m256i one = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    __m256i its = _mm256_and_si256(_mm256_set1_epi32((int)which), one);
    return (mask){_mm256_castsi256_ps(_mm256_cmpeq_epi32(its, one))};
}

static inline unsigned bits(mask a) {
    return (unsigned)_mm256_movemask_ps(a.all);
}

static inline unsigned any_of_four(mask a, mask b, mask c, mask d) {
    __m256i ab = _mm256_packs_epi32(_mm256_castps_si256(a.all), _mm256_castps_si256(b.all));
    __m256i cd = _mm256_packs_epi32(_mm256_castps_si256(c.all), _mm256_castps_si256(d.all));
    __m256i none = _mm256_cmpeq_epi32(_mm256_packs_epi16(ab, cd), _mm256_setzero_si256());
    unsigned of_half = (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(none));
    return ~(of_half & of_half >> 4) & 15;
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

static inline real least_of(real a, real b) {
    return _mm256_min_ps(a, b);
}

static inline real most_of(real a, real b) {
    return _mm256_max_ps(a, b);
}

static inline float least_lane(real a) {
    COUNT(least_lane, call);
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

// 1/√a for normal a > 0, to an ulp or two.
static inline real inverse_root(real a) {
    COUNT(inverse_root, call);
    COUNT(inverse_root, exact);
    return set(1.0f) / _mm256_sqrt_ps(a);
}

static inline real guess_inverse(real a) {
    __m256i bits = _mm256_sub_epi32(_mm256_set1_epi32(0x7ef311c3), _mm256_castps_si256(a));
    return _mm256_castsi256_ps(bits);
}

// a·b + c in the lanes of m, a in the others.
static inline real mul_add_where(mask m, real a, real b, real c) {
    return _mm256_blendv_ps(a, _mm256_fmadd_ps(a, b, c), m.all);
}

static inline mask less_in(mask m, real a, real b) {
    return both(m, less(a, b));
}

static inline mask greater_in(mask m, real a, real b) {
    return both(m, greater(a, b));
}

static inline mask not_less_in(mask m, real a, real b) {
    return both(m, not_less(a, b));
}

static inline mask but_less(mask m, real a, real b) {
    return (mask){_mm256_and_ps(m.all, _mm256_cmp_ps(a, b, _CMP_NLT_UQ))};
}

static inline mask but_greater(mask m, real a, real b) {
    return (mask){_mm256_and_ps(m.all, _mm256_cmp_ps(a, b, _CMP_NGT_UQ))};
}

static inline mask but_not_less(mask m, real a, real b) {
    return (mask){_mm256_and_ps(m.all, _mm256_cmp_ps(a, b, _CMP_NGE_UQ))};
}

// 1/√a to 14 bits and better, for normal a > 0: 12 bits and once Newton's step.
static inline real rough_inverse_root(real a) {
    COUNT(rough_inverse_root, call);
    real r = _mm256_rsqrt_ps(a);
    return r * _mm256_fnmadd_ps(a * r, r * set(0.5f), set(1.5f));
}

// 1/√a to 11 bits, for normal a > 0.
static inline real root_guess(real a) {
    COUNT(root_guess, call);
    return _mm256_rsqrt_ps(a);
}

// 2·times/(√a·b) for normal a > 0 and b: a step of Newton's for each.
static inline real twice_over_root(real times, real a, real b) {
    COUNT(twice_over_root, call);
    COUNT(twice_over_root, eight);
    real per = _mm256_rcp_ps(b);
    per = per * _mm256_fnmadd_ps(b, per, set(2.0f));
    return (times + times) * rough_inverse_root(a) * per;
}

// √a of a normal a > 0, to a few ulp. No third value is kept as with 16 lanes: there are 16 registers.
struct rooted {
    real inverse, root;
};

static inline struct rooted rooted(real a) {
    COUNT(rooted, call);
    COUNT(rooted, eight);
    real r = rough_inverse_root(a);
    return (struct rooted){r, a * r};
}

// 2·b·√a
static inline real twice_root_times(const struct rooted *a, real b) {
    COUNT(twice_root_times, call);
    COUNT(twice_root_times, eight);
    return (b + b) * a->root;
}

// b/a; 1/a itself may be below what is normal.
static inline real divided_by(real b, const struct rooted *a) {
    COUNT(divided_by, call);
    COUNT(divided_by, eight);
    return b * a->inverse * a->inverse;
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

// 2 to the power of minus a's exponent.
static inline real power_per(real a) {
    __m256i field = _mm256_and_si256(_mm256_castps_si256(a), _mm256_set1_epi32(0x7f800000));
    return _mm256_castsi256_ps(_mm256_sub_epi32(_mm256_set1_epi32(0x7f000000), field));
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

// The whole numbers of those lanes in a row, from `to` on: LANES are written.
static inline void pack_whole(mask m, const int from[LANES], int to[LANES]) {
    __m256i all = _mm256_loadu_si256((const __m256i *)from);
    _mm256_storeu_si256((__m256i *)to, _mm256_permutevar8x32_epi32(all, packing_of(m)));
}

// first + 2^shift·lane of those lanes in a row: LANES are written.
static inline void pack_numbers(mask m, int first, int shift, int to[LANES]) {
    __m256i numbers = _mm256_slli_epi32(packing_of(m), shift);
    _mm256_storeu_si256((__m256i *)to, _mm256_add_epi32(numbers, _mm256_set1_epi32(first)));
}

// Numbers of places in the lanes of m, the first of them in the others; LANES are read.
static inline packing places_of(mask m, const unsigned short from[LANES]) {
    __m256i numbers = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)from));
    return _mm256_blendv_epi8(_mm256_set1_epi32(from[0]), numbers, _mm256_castps_si256(m.all));
}

// What is there. A lane at a time it goes by way of memory, which waits for all of it.
static inline real load_from(const float *from, packing places) {
    return _mm256_i32gather_ps(from, places, sizeof *from);
}

// The other way round, for many: floats in rows `stride` apart into the lanes of each of `to`.
static inline void expand_rows(real *to, int count, unsigned lanes, const float *from, int stride) {
    for (; lanes; lanes &= lanes - 1, from++) {
        float *lane = (float *)to + __builtin_ctz(lanes);
        for (int i = 0; i < count; i++)
            lane[i * LANES] = from[(size_t)i * (size_t)stride];
    }
}

// `count` registers' lanes `here` into the lanes `there` of others: as many, in their order.
static inline void move_lanes(float *to, unsigned there, const float *from, unsigned here,
                              int count) {
    for (; here; here &= here - 1, there &= there - 1)
        for (int i = 0; i < count; i++)
            to[i * LANES + __builtin_ctz(there)] = from[i * LANES + __builtin_ctz(here)];
}

// Red, green and blue of a block of 4 x 2 pixels, each row 12 floats `stride` apart.
static inline void store_block(float *rgb, size_t stride, real r, real g, real b) {
    // In each half of a register (a row) r0 r2 g0 g2, g1 g3 b1 b3, b0 b2 r1 r3.
    real rg = _mm256_shuffle_ps(r, g, _MM_SHUFFLE(2, 0, 2, 0));
    real gb = _mm256_shuffle_ps(g, b, _MM_SHUFFLE(3, 1, 3, 1));
    real br = _mm256_shuffle_ps(b, r, _MM_SHUFFLE(3, 1, 2, 0));
    const real third[3] = {_mm256_shuffle_ps(rg, br, _MM_SHUFFLE(2, 0, 2, 0)),  // r0 g0 b0 r1
                           _mm256_shuffle_ps(gb, rg, _MM_SHUFFLE(3, 1, 2, 0)),  // g1 b1 r2 g2
                           _mm256_shuffle_ps(br, gb, _MM_SHUFFLE(3, 1, 3, 1))}; // b2 r3 g3 b3
    for (int i = 0; i < 3; i++) {
        _mm_storeu_ps(rgb + 4 * i, _mm256_castps256_ps128(third[i]));
        _mm_storeu_ps(rgb + stride + 4 * i, _mm256_extractf128_ps(third[i], 1));
    }
}

// One row of two blocks of 4 x 2 that lie one behind the other.
static inline real row_of(const float *from) {
    __m256 a = _mm256_castps128_ps256(_mm_loadu_ps(from));
    return _mm256_insertf128_ps(a, _mm_loadu_ps(from + 8), 1);
}

// Red, green and blue of 8 pixels in a row.
static inline void store_row(float *rgb, bool past, real r, real g, real b) {
    // In each half of a register (four pixels) as in store_block.
    real rg = _mm256_shuffle_ps(r, g, _MM_SHUFFLE(2, 0, 2, 0));
    real gb = _mm256_shuffle_ps(g, b, _MM_SHUFFLE(3, 1, 3, 1));
    real br = _mm256_shuffle_ps(b, r, _MM_SHUFFLE(3, 1, 2, 0));
    real first = _mm256_shuffle_ps(rg, br, _MM_SHUFFLE(2, 0, 2, 0));
    real second = _mm256_shuffle_ps(gb, rg, _MM_SHUFFLE(3, 1, 2, 0));
    real third = _mm256_shuffle_ps(br, gb, _MM_SHUFFLE(3, 1, 3, 1));
    put(rgb, past, _mm256_permute2f128_ps(first, second, 0x20));
    put(rgb + 8, past, _mm256_permute2f128_ps(third, first, 0x30));
    put(rgb + 16, past, _mm256_permute2f128_ps(second, third, 0x31));
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

#endif
