// Sixteen lanes: AVX-512 F and DQ. See lanes.h.
#ifndef OPT10_LANES16_H
#define OPT10_LANES16_H

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

// past: the caches, to a place that is a multiple of a register.
static inline void put(float *to, bool past, real a) {
    if (!past)
        _mm512_storeu_ps(to, a);
    else
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__ // gcc's do not see the instruction
        *(real *)to = a;
#else
        _mm512_stream_ps(to, a);
#endif
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
    return (mask){a.all & b.all};
}

static inline mask either(mask a, mask b) {
    return (mask){a.all | b.all};
}

static inline mask but_not(mask a, mask b) {
    return (mask){_kandn_mask16(a.all, b.all)};
}

// The other way round from bits().
static inline mask lanes_of(unsigned which) {
    return (mask){(__mmask16)which};
}

static inline unsigned bits(mask a) {
    return a.all;
}

static inline unsigned any_of_four(mask a, mask b, mask c, mask d) {
    return (unsigned)(bits(a) != 0) | (unsigned)(bits(b) != 0) << 1 |
           (unsigned)(bits(c) != 0) << 2 | (unsigned)(bits(d) != 0) << 3;
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

static inline real absolute(real a) {
    return _mm512_andnot_ps(set(-0.0f), a);
}

static inline real with_sign_of(real from, real a) {
    return _mm512_or_ps(_mm512_and_ps(set(-0.0f), from), absolute(a));
}

static inline real root(real a) {
    return _mm512_sqrt_ps(a);
}

// 1/√a for normal a > 0, to an ulp or two.
static inline real inverse_root(real a) {
    COUNT(inverse_root, call);
    COUNT(inverse_root, rough);
    // 14 bits, and once Newton's step.
    real r = _mm512_rsqrt14_ps(a);
    return r * _mm512_fnmadd_ps(a * r, r * set(0.5f), set(1.5f));
}

static inline real guess_inverse(real a) {
    __m512i bits = _mm512_sub_epi32(_mm512_set1_epi32(0x7ef311c3), _mm512_castps_si512(a));
    return _mm512_castsi512_ps(bits);
}

// 1/√a to 14 bits, for normal a > 0.
static inline real root_guess(real a) {
    COUNT(root_guess, call);
    return _mm512_rsqrt14_ps(a);
}

// a·b + c in the lanes of m, a in the others.
static inline real mul_add_where(mask m, real a, real b, real c) {
    return _mm512_mask_fmadd_ps(a, m.all, b, c);
}

// A comparison of some lanes is one instruction, and waits for no other's mask to be joined with it.
static inline mask less_in(mask m, real a, real b) {
    return (mask){_mm512_mask_cmp_ps_mask(m.all, a, b, _CMP_LT_OQ)};
}

static inline mask greater_in(mask m, real a, real b) {
    return (mask){_mm512_mask_cmp_ps_mask(m.all, a, b, _CMP_GT_OQ)};
}

static inline mask not_less_in(mask m, real a, real b) {
    return (mask){_mm512_mask_cmp_ps_mask(m.all, a, b, _CMP_GE_OQ)};
}

static inline mask but_less(mask m, real a, real b) {
    return (mask){_mm512_mask_cmp_ps_mask(m.all, a, b, _CMP_NLT_UQ)};
}

static inline mask but_greater(mask m, real a, real b) {
    return (mask){_mm512_mask_cmp_ps_mask(m.all, a, b, _CMP_NGT_UQ)};
}

static inline mask but_not_less(mask m, real a, real b) {
    return (mask){_mm512_mask_cmp_ps_mask(m.all, a, b, _CMP_NGE_UQ)};
}

// 1/√a from 14 bits by one step, for normal a > 0.
static inline real rough_inverse_root(real a) {
    COUNT(rough_inverse_root, call);
    real r = _mm512_rsqrt14_ps(a);
    return r * _mm512_fnmadd_ps(a * r, r * set(0.5f), set(1.5f));
}

// 2·times/(√a·b) for normal a > 0 and b: a guess of 14 bits each, whose errors are taken off together. 1/(√a·b) alone may
// be below what is normal.
static inline real twice_over_root(real times, real a, real b) {
    COUNT(twice_over_root, call);
    COUNT(twice_over_root, sixteen);
    real r = _mm512_rsqrt14_ps(a), per = _mm512_rcp14_ps(b), part = times * r * per;
    real off = _mm512_fnmadd_ps(a * r, r, set(1.0f)), off_b = _mm512_fnmadd_ps(b, per, set(1.0f));
    return _mm512_fmadd_ps(part, off + (off_b + off_b), part + part);
}

// √a of a normal a > 0: both to 14 bits, and what 1 − a·inverse² is, for one step of Newton's.
struct rooted {
    real inverse, root, off;
};

static inline struct rooted rooted(real a) {
    COUNT(rooted, call);
    COUNT(rooted, sixteen);
    real r = _mm512_rsqrt14_ps(a), h = a * r;
    return (struct rooted){r, h, _mm512_fnmadd_ps(h, r, set(1.0f))};
}

// 2·b·√a to an ulp or two. Sums in place of products where both will do: Zen has units for either.
static inline real twice_root_times(const struct rooted *a, real b) {
    COUNT(twice_root_times, call);
    COUNT(twice_root_times, sixteen);
    real part = b * a->root;
    return _mm512_fmadd_ps(part, a->off, part + part);
}

// b/a to an ulp or two; 1/a itself may be below what is normal.
static inline real divided_by(real b, const struct rooted *a) {
    COUNT(divided_by, call);
    COUNT(divided_by, sixteen);
    real part = b * a->inverse * a->inverse;
    return _mm512_fmadd_ps(part, a->off, part);
}

// a = mantissa·2^exponent, 3/4 ≤ mantissa < 3/2.
static inline real mantissa_near_1(real a, real *exponent) {
    *exponent = _mm512_getexp_ps(a * set(4.0f / 3.0f));
    return _mm512_getmant_ps(a, _MM_MANT_NORM_p75_1p5, _MM_MANT_SIGN_src);
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

// 2 to the power of minus a's exponent.
static inline real power_per(real a) {
    __m512i field = _mm512_and_si512(_mm512_castps_si512(a), _mm512_set1_epi32(0x7f800000));
    return _mm512_castsi512_ps(_mm512_sub_epi32(_mm512_set1_epi32(0x7f000000), field));
}

static inline __m512i own_lanes(void) {
    return _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}

// A permutation is one instruction of one step, to compress or to expand is two: so that is done once, of the lanes'
// numbers, for all rows that are moved alike (opt9_convex's NOTES, "Lanes moved by permutations").
typedef __m512i packing;

static inline packing packing_of(mask m) {
    return _mm512_maskz_compress_epi32(m.all, own_lanes());
}

static inline void pack_by(packing p, real a, float to[LANES]) {
    _mm512_storeu_ps(to, _mm512_permutexvar_ps(p, a));
}

// The lanes of m in a row, from `to` on: LANES floats are written.
static inline void pack(mask m, real a, float to[LANES]) {
    pack_by(packing_of(m), a, to);
}

// The whole numbers of those lanes in a row, from `to` on: LANES are written.
static inline void pack_whole(mask m, const int from[LANES], int to[LANES]) {
    _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(m.all, _mm512_loadu_si512(from)));
}

// first + 2^shift·lane of those lanes in a row: LANES are written.
static inline void pack_numbers(mask m, int first, int shift, int to[LANES]) {
    __m512i numbers = _mm512_slli_epi32(packing_of(m), (unsigned)shift);
    _mm512_storeu_si512(to, _mm512_add_epi32(numbers, _mm512_set1_epi32(first)));
}

// Numbers of places in the lanes of m, the first of them in the others; LANES are read.
static inline packing places_of(mask m, const unsigned short from[LANES]) {
    __m256i low = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)from));
    __m256i high = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)from + 1));
    real numbers = _mm512_insertf32x8(_mm512_castps256_ps512(_mm256_castsi256_ps(low)),
                                      _mm256_castsi256_ps(high), 1);
    real first = _mm512_castsi512_ps(_mm512_set1_epi32(from[0]));
    return _mm512_castps_si512(choose(m, numbers, first));
}

// What is there. A lane at a time it goes by way of memory, which waits for all of it.
static inline real load_from(const float *from, packing places) {
    return _mm512_i32gather_ps(places, from, sizeof *from);
}

// Which lane of two registers each lane is to hold: its own of the first, or, in the lanes `there`, one of the second:
// those of `here`, in their order.
static inline __m512i lanes_taken(unsigned there, unsigned here) {
    __m512i second = _mm512_add_epi32(own_lanes(), _mm512_set1_epi32(LANES));
    return _mm512_mask_expand_epi32(own_lanes(), (__mmask16)there,
                                    _mm512_maskz_compress_epi32((__mmask16)here, second));
}

// The other way round from pack(): floats in a row into the lanes of `to`, for many, whose floats are in rows `stride`
// apart. LANES floats are read.
static inline void expand_rows(real *to, int count, unsigned lanes, const float *from, int stride) {
    __m512i taken = lanes_taken(lanes, 0xffff);
    for (int i = 0; i < count; i++)
        to[i] = _mm512_permutex2var_ps(to[i], taken, load(from + (size_t)i * (size_t)stride));
}

// `count` registers' lanes `here` into the lanes `there` of others: as many, in their order.
static inline void move_lanes(float *to, unsigned there, const float *from, unsigned here,
                              int count) {
    __m512i taken = lanes_taken(there, here);
    for (int i = 0; i < count; i++, to += LANES, from += LANES)
        unload(_mm512_permutex2var_ps(load(to), taken, load(from)), to);
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

// One row of four blocks of 4 x 4 that lie one behind the other.
static inline real row_of(const float *from) {
    __m512 a = _mm512_castps128_ps512(_mm_loadu_ps(from));
    a = _mm512_insertf32x4(a, _mm_loadu_ps(from + 16), 1);
    a = _mm512_insertf32x4(a, _mm_loadu_ps(from + 32), 2);
    return _mm512_insertf32x4(a, _mm_loadu_ps(from + 48), 3);
}

// Red, green and blue of 16 pixels in a row.
static inline void store_row(float *rgb, bool past, real r, real g, real b) {
    // Of each of the three registers which lanes come from red, which from green (from 16 on), then which from blue.
    const __m512i rg[3] = {
        _mm512_setr_epi32(0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5),
        _mm512_setr_epi32(21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26),
        _mm512_setr_epi32(0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0)};
    const __m512i to_b[3] = {
        _mm512_setr_epi32(0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15),
        _mm512_setr_epi32(0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15),
        _mm512_setr_epi32(26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31)};
    for (int i = 0; i < 3; i++)
        put(rgb + 16 * i, past,
            _mm512_permutex2var_ps(_mm512_permutex2var_ps(r, rg[i], g), to_b[i], b));
}

static inline half half_set(double a) {
    return _mm512_set1_pd(a);
}

static inline half half_mul_add(half a, half b, half c) {
    return _mm512_fmadd_pd(a, b, c);
}

static inline half half_neg_mul_add(half a, half b, half c) {
    return _mm512_fnmadd_pd(a, b, c);
}

// 1/√a to 14 bits.
static inline half half_rough_inverse_root(half a) {
    return _mm512_rsqrt14_pd(a);
}

static inline half half_root(half a) {
    return _mm512_sqrt_pd(a);
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

#endif
