// Eight lanes: AVX2, two registers of 64-bit lanes. See number.h.
#ifndef FIXED_LANES8_H
#define FIXED_LANES8_H

#include <immintrin.h>
#include <string.h>

typedef struct {
    __m256i a, b;
} num;

typedef struct {
    __m256i a, b; // all bits of a lane, or none
} mask;

static inline num set(int64_t a) {
    return (num){_mm256_set1_epi64x(a), _mm256_set1_epi64x(a)};
}

static inline num ramp(void) {
    return (num){_mm256_setr_epi64x(0, 1, 2, 3), _mm256_setr_epi64x(4, 5, 6, 7)};
}

static inline num load(const int64_t from[LANES]) {
    return (num){_mm256_loadu_si256((const __m256i *)(from)),
                 _mm256_loadu_si256((const __m256i *)(from + LANES / 2))};
}

static inline num plus(num x, num y) {
    return (num){_mm256_add_epi64(x.a, y.a), _mm256_add_epi64(x.b, y.b)};
}

static inline num minus(num x, num y) {
    return (num){_mm256_sub_epi64(x.a, y.a), _mm256_sub_epi64(x.b, y.b)};
}

static inline num product(num x, num y) {
    return (num){_mm256_mul_epi32(x.a, y.a), _mm256_mul_epi32(x.b, y.b)};
}

static inline num and_bits(num x, num y) {
    return (num){_mm256_and_si256(x.a, y.a), _mm256_and_si256(x.b, y.b)};
}

static inline num or_bits(num x, num y) {
    return (num){_mm256_or_si256(x.a, y.a), _mm256_or_si256(x.b, y.b)};
}

// AVX2 has no such shift: of numbers between −2^62 and 2^62, moved up by 2^62 and down again.
static inline __m256i shifted_half(__m256i x, __m256i by) {
    const __m256i up = _mm256_set1_epi64x(INT64_C(1) << 62);
    return _mm256_sub_epi64(_mm256_srlv_epi64(_mm256_add_epi64(x, up), by),
                            _mm256_srlv_epi64(up, by));
}

// Right, with the sign; left and right as bits, of any lane its own: by 64 or more, or less than 0, nothing is left.
static inline num shifted(num x, int by) {
    const __m256i n = _mm256_set1_epi64x(by);
    return (num){shifted_half(x.a, n), shifted_half(x.b, n)};
}

static inline num shifted_each(num x, num y) {
    return (num){shifted_half(x.a, y.a), shifted_half(x.b, y.b)};
}

static inline num left(num x, int by) {
    const __m256i n = _mm256_set1_epi64x(by);
    return (num){_mm256_sllv_epi64(x.a, n), _mm256_sllv_epi64(x.b, n)};
}

static inline num right(num x, int by) {
    const __m256i n = _mm256_set1_epi64x(by);
    return (num){_mm256_srlv_epi64(x.a, n), _mm256_srlv_epi64(x.b, n)};
}

static inline num left_each(num x, num y) {
    return (num){_mm256_sllv_epi64(x.a, y.a), _mm256_sllv_epi64(x.b, y.b)};
}

static inline num right_each(num x, num y) {
    return (num){_mm256_srlv_epi64(x.a, y.a), _mm256_srlv_epi64(x.b, y.b)};
}

// The lower 32 bits of a lane are a float's, the others 0: so are those of what is added.
static inline num add_float(num bits, float a) {
    uint32_t low;
    memcpy(&low, &a, sizeof low);
    const __m256 more = _mm256_castsi256_ps(_mm256_set1_epi64x(low));
    return (num){_mm256_castps_si256(_mm256_add_ps(_mm256_castsi256_ps(bits.a), more)),
                 _mm256_castps_si256(_mm256_add_ps(_mm256_castsi256_ps(bits.b), more))};
}

static inline num add_double(num bits, double a) {
    const __m256d more = _mm256_set1_pd(a);
    return (num){_mm256_castpd_si256(_mm256_add_pd(_mm256_castsi256_pd(bits.a), more)),
                 _mm256_castpd_si256(_mm256_add_pd(_mm256_castsi256_pd(bits.b), more))};
}

// AVX2 converts no 64-bit integers: their halves beside the exponents of 2^84 (with the sign's 2^63 more) and
// 2^52, less those; the sum is rounded once.
static inline __m256d double_half(__m256i x) {
    const __m256i high_one = _mm256_set1_epi64x(0x4530000080000000),
                  low_one = _mm256_set1_epi64x(0x4330000000000000);
    __m256i high = _mm256_xor_si256(_mm256_srli_epi64(x, 32), high_one);
    __m256i low = _mm256_blend_epi16(x, low_one, 0xcc);
    __m256d top =
        _mm256_sub_pd(_mm256_castsi256_pd(high), _mm256_set1_pd(0x1p84 + 0x1p63 + 0x1p52));
    return _mm256_add_pd(top, _mm256_castsi256_pd(low));
}

// The bits of the double nearest to a whole number.
static inline num as_double(num x) {
    return (num){_mm256_castpd_si256(double_half(x.a)), _mm256_castpd_si256(double_half(x.b))};
}

static inline mask less(num x, num y) {
    return (mask){_mm256_cmpgt_epi64(y.a, x.a), _mm256_cmpgt_epi64(y.b, x.b)};
}

static inline mask both(mask x, mask y) {
    return (mask){_mm256_and_si256(x.a, y.a), _mm256_and_si256(x.b, y.b)};
}

static inline mask either(mask x, mask y) {
    return (mask){_mm256_or_si256(x.a, y.a), _mm256_or_si256(x.b, y.b)};
}

static inline mask but_not(mask x, mask y) {
    return (mask){_mm256_andnot_si256(x.a, y.a), _mm256_andnot_si256(x.b, y.b)};
}

static inline bool any(mask x) {
    const __m256i all = _mm256_or_si256(x.a, x.b);
    return !_mm256_testz_si256(all, all);
}

static inline unsigned bits_of(mask x) {
    int a = _mm256_movemask_pd(_mm256_castsi256_pd(x.a)),
        b = _mm256_movemask_pd(_mm256_castsi256_pd(x.b));
    return (unsigned)(a | b << 4);
}

static inline num choose(mask m, num yes, num no) {
    return (num){_mm256_blendv_epi8(no.a, yes.a, m.a), _mm256_blendv_epi8(no.b, yes.b, m.b)};
}

static inline num look_up(const int64_t *table, num at) {
    const long long *from = (const long long *)table;
    return (num){_mm256_i64gather_epi64(from, at.a, 8), _mm256_i64gather_epi64(from, at.b, 8)};
}

static inline mask bit_set(num x, int k) {
    const __m256i bit = _mm256_set1_epi64x(INT64_C(1) << k);
    return (mask){_mm256_cmpeq_epi64(_mm256_and_si256(x.a, bit), bit),
                  _mm256_cmpeq_epi64(_mm256_and_si256(x.b, bit), bit)};
}

static inline void unload_wide(num x, double scale, double to[LANES]) {
    const __m256d by = _mm256_set1_pd(scale);
    _mm256_storeu_pd(to, double_half(x.a) * by);
    _mm256_storeu_pd(to + 4, double_half(x.b) * by);
}

static inline void unload(num x, double scale, float to[LANES]) {
    const __m256d by = _mm256_set1_pd(scale);
    _mm_storeu_ps(to, _mm256_cvtpd_ps(double_half(x.a) * by));
    _mm_storeu_ps(to + 4, _mm256_cvtpd_ps(double_half(x.b) * by));
}

static inline mask positive(num x) {
    return less(set(0), x);
}

static inline mask first_lanes(int count) {
    return less(ramp(), set(count));
}

static inline bool bit_of(mask x, int lane) {
    return bits_of(x) >> lane & 1;
}

#endif
