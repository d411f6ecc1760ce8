// Eight lanes: two AVX2 registers of four 64-bit lanes. Included by lanes.h.
#ifndef FIXED_LANES8_H
#define FIXED_LANES8_H

#include <immintrin.h>
#include <string.h>

typedef struct {
    __m256i a, b;
} vnum;

typedef struct {
    __m256i a, b; // all bits of a lane, or none
} vmask;

static inline vnum v_splat(int64_t a) {
    return (vnum){_mm256_set1_epi64x(a), _mm256_set1_epi64x(a)};
}

static inline vnum v_iota(void) {
    return (vnum){_mm256_setr_epi64x(0, 1, 2, 3), _mm256_setr_epi64x(4, 5, 6, 7)};
}

static inline vnum v_load(const int64_t from[LANES]) {
    return (vnum){_mm256_loadu_si256((const __m256i *)(from)),
                  _mm256_loadu_si256((const __m256i *)(from + LANES / 2))};
}

static inline vnum v_add(vnum x, vnum y) {
    return (vnum){_mm256_add_epi64(x.a, y.a), _mm256_add_epi64(x.b, y.b)};
}

static inline vnum v_sub(vnum x, vnum y) {
    return (vnum){_mm256_sub_epi64(x.a, y.a), _mm256_sub_epi64(x.b, y.b)};
}

static inline vnum v_mul_wide(vnum x, vnum y) {
    return (vnum){_mm256_mul_epi32(x.a, y.a), _mm256_mul_epi32(x.b, y.b)};
}

static inline vnum v_and_bits(vnum x, vnum y) {
    return (vnum){_mm256_and_si256(x.a, y.a), _mm256_and_si256(x.b, y.b)};
}

static inline vnum v_or_bits(vnum x, vnum y) {
    return (vnum){_mm256_or_si256(x.a, y.a), _mm256_or_si256(x.b, y.b)};
}

// AVX2 has no arithmetic shift of 64 bits. A number between −2^62 and 2^62 is made positive by adding 2^62,
// shifted as bits, and the shifted 2^62 is subtracted: exact.
static inline __m256i sra_half(__m256i x, __m256i by) {
    const __m256i up = _mm256_set1_epi64x(INT64_C(1) << 62);
    return _mm256_sub_epi64(_mm256_srlv_epi64(_mm256_add_epi64(x, up), by),
                            _mm256_srlv_epi64(up, by));
}

// v_sra, v_srav keep the sign; the other shifts move bits. By more than 63 bits or less than 0 nothing is left.
static inline vnum v_sra(vnum x, int by) {
    const __m256i n = _mm256_set1_epi64x(by);
    return (vnum){sra_half(x.a, n), sra_half(x.b, n)};
}

static inline vnum v_srav(vnum x, vnum y) {
    return (vnum){sra_half(x.a, y.a), sra_half(x.b, y.b)};
}

static inline vnum v_sll(vnum x, int by) {
    const __m256i n = _mm256_set1_epi64x(by);
    return (vnum){_mm256_sllv_epi64(x.a, n), _mm256_sllv_epi64(x.b, n)};
}

static inline vnum v_srl(vnum x, int by) {
    const __m256i n = _mm256_set1_epi64x(by);
    return (vnum){_mm256_srlv_epi64(x.a, n), _mm256_srlv_epi64(x.b, n)};
}

static inline vnum v_sllv(vnum x, vnum y) {
    return (vnum){_mm256_sllv_epi64(x.a, y.a), _mm256_sllv_epi64(x.b, y.b)};
}

static inline vnum v_srlv(vnum x, vnum y) {
    return (vnum){_mm256_srlv_epi64(x.a, y.a), _mm256_srlv_epi64(x.b, y.b)};
}

// Adds `a` to the float in the lower 32 bits of each lane; the upper 32 bits are 0 before and after.
static inline vnum v_add_float(vnum bits, float a) {
    uint32_t low;
    memcpy(&low, &a, sizeof low);
    const __m256 more = _mm256_castsi256_ps(_mm256_set1_epi64x(low));
    return (vnum){_mm256_castps_si256(_mm256_add_ps(_mm256_castsi256_ps(bits.a), more)),
                  _mm256_castps_si256(_mm256_add_ps(_mm256_castsi256_ps(bits.b), more))};
}

static inline vnum v_add_double(vnum bits, double a) {
    const __m256d more = _mm256_set1_pd(a);
    return (vnum){_mm256_castpd_si256(_mm256_add_pd(_mm256_castsi256_pd(bits.a), more)),
                  _mm256_castpd_si256(_mm256_add_pd(_mm256_castsi256_pd(bits.b), more))};
}

// AVX2 does not convert 64-bit integers to double. The upper half is placed beside the exponent of 2^84, the lower
// one beside that of 2^52. The two offsets, and 2^63 for the sign, are subtracted; the sum is rounded once.
static inline __m256d double_half(__m256i x) {
    const __m256i high_one = _mm256_set1_epi64x(0x4530000080000000),
                  low_one = _mm256_set1_epi64x(0x4330000000000000);
    __m256i high = _mm256_xor_si256(_mm256_srli_epi64(x, 32), high_one);
    __m256i low = _mm256_blend_epi16(x, low_one, 0xcc);
    __m256d top =
        _mm256_sub_pd(_mm256_castsi256_pd(high), _mm256_set1_pd(0x1p84 + 0x1p63 + 0x1p52));
    return _mm256_add_pd(top, _mm256_castsi256_pd(low));
}

// Returns the bits of the double nearest to an integer.
static inline vnum v_double_bits(vnum x) {
    return (vnum){_mm256_castpd_si256(double_half(x.a)), _mm256_castpd_si256(double_half(x.b))};
}

static inline vmask v_cmp_lt(vnum x, vnum y) {
    return (vmask){_mm256_cmpgt_epi64(y.a, x.a), _mm256_cmpgt_epi64(y.b, x.b)};
}

static inline vmask v_and(vmask x, vmask y) {
    return (vmask){_mm256_and_si256(x.a, y.a), _mm256_and_si256(x.b, y.b)};
}

static inline vmask v_or(vmask x, vmask y) {
    return (vmask){_mm256_or_si256(x.a, y.a), _mm256_or_si256(x.b, y.b)};
}

static inline vmask v_andnot(vmask x, vmask y) {
    return (vmask){_mm256_andnot_si256(x.a, y.a), _mm256_andnot_si256(x.b, y.b)};
}

static inline bool v_any(vmask x) {
    const __m256i all = _mm256_or_si256(x.a, x.b);
    return !_mm256_testz_si256(all, all);
}

static inline unsigned v_mask_bits(vmask x) {
    int a = _mm256_movemask_pd(_mm256_castsi256_pd(x.a)),
        b = _mm256_movemask_pd(_mm256_castsi256_pd(x.b));
    return (unsigned)(a | b << 4);
}

static inline vnum v_select(vmask m, vnum yes, vnum no) {
    return (vnum){_mm256_blendv_epi8(no.a, yes.a, m.a), _mm256_blendv_epi8(no.b, yes.b, m.b)};
}

static inline vnum v_lookup(const int64_t *table, vnum at) {
    const long long *from = (const long long *)table;
    return (vnum){_mm256_i64gather_epi64(from, at.a, 8), _mm256_i64gather_epi64(from, at.b, 8)};
}

static inline vmask v_test_bit(vnum x, int k) {
    const __m256i bit = _mm256_set1_epi64x(INT64_C(1) << k);
    return (vmask){_mm256_cmpeq_epi64(_mm256_and_si256(x.a, bit), bit),
                   _mm256_cmpeq_epi64(_mm256_and_si256(x.b, bit), bit)};
}

static inline void v_store_double(vnum x, double scale, double to[LANES]) {
    const __m256d by = _mm256_set1_pd(scale);
    _mm256_storeu_pd(to, double_half(x.a) * by);
    _mm256_storeu_pd(to + 4, double_half(x.b) * by);
}

static inline void v_store_float(vnum x, double scale, float to[LANES]) {
    const __m256d by = _mm256_set1_pd(scale);
    _mm_storeu_ps(to, _mm256_cvtpd_ps(double_half(x.a) * by));
    _mm_storeu_ps(to + 4, _mm256_cvtpd_ps(double_half(x.b) * by));
}

static inline vmask v_positive(vnum x) {
    return v_cmp_lt(v_splat(0), x);
}

static inline vmask v_mask_first(int count) {
    return v_cmp_lt(v_iota(), v_splat(count));
}

static inline bool v_mask_lane(vmask x, int lane) {
    return v_mask_bits(x) >> lane & 1;
}

#endif
