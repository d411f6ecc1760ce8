// Sixteen lanes: AVX-512 F and DQ, two registers of 64-bit lanes. See number.h.
#ifndef FIXED_LANES16_H
#define FIXED_LANES16_H

#include <immintrin.h>
#include <string.h>

typedef struct {
    __m512i a, b;
} num;

typedef struct {
    __mmask8 a, b;
} mask;

static inline num set(int64_t a) {
    return (num){_mm512_set1_epi64(a), _mm512_set1_epi64(a)};
}

static inline num ramp(void) {
    return (num){_mm512_setr_epi64(0, 1, 2, 3, 4, 5, 6, 7),
                 _mm512_setr_epi64(8, 9, 10, 11, 12, 13, 14, 15)};
}

static inline num load(const int64_t from[LANES]) {
    return (num){_mm512_loadu_si512(from), _mm512_loadu_si512(from + LANES / 2)};
}

static inline num plus(num x, num y) {
    return (num){_mm512_add_epi64(x.a, y.a), _mm512_add_epi64(x.b, y.b)};
}

static inline num minus(num x, num y) {
    return (num){_mm512_sub_epi64(x.a, y.a), _mm512_sub_epi64(x.b, y.b)};
}

static inline num product(num x, num y) {
    return (num){_mm512_mul_epi32(x.a, y.a), _mm512_mul_epi32(x.b, y.b)};
}

static inline num and_bits(num x, num y) {
    return (num){_mm512_and_si512(x.a, y.a), _mm512_and_si512(x.b, y.b)};
}

static inline num or_bits(num x, num y) {
    return (num){_mm512_or_si512(x.a, y.a), _mm512_or_si512(x.b, y.b)};
}

// Right, with the sign; left and right as bits, of any lane its own: by 64 or more, or less than 0, nothing is left.
static inline num shifted(num x, int by) {
    const __m512i n = _mm512_set1_epi64(by);
    return (num){_mm512_srav_epi64(x.a, n), _mm512_srav_epi64(x.b, n)};
}

static inline num shifted_each(num x, num y) {
    return (num){_mm512_srav_epi64(x.a, y.a), _mm512_srav_epi64(x.b, y.b)};
}

static inline num left(num x, int by) {
    const __m512i n = _mm512_set1_epi64(by);
    return (num){_mm512_sllv_epi64(x.a, n), _mm512_sllv_epi64(x.b, n)};
}

static inline num right(num x, int by) {
    const __m512i n = _mm512_set1_epi64(by);
    return (num){_mm512_srlv_epi64(x.a, n), _mm512_srlv_epi64(x.b, n)};
}

static inline num left_each(num x, num y) {
    return (num){_mm512_sllv_epi64(x.a, y.a), _mm512_sllv_epi64(x.b, y.b)};
}

static inline num right_each(num x, num y) {
    return (num){_mm512_srlv_epi64(x.a, y.a), _mm512_srlv_epi64(x.b, y.b)};
}

// The lower 32 bits of a lane are a float's, the others 0: so are those of what is added.
static inline num add_float(num bits, float a) {
    uint32_t low;
    memcpy(&low, &a, sizeof low);
    const __m512 more = _mm512_castsi512_ps(_mm512_set1_epi64(low));
    return (num){_mm512_castps_si512(_mm512_add_ps(_mm512_castsi512_ps(bits.a), more)),
                 _mm512_castps_si512(_mm512_add_ps(_mm512_castsi512_ps(bits.b), more))};
}

static inline num add_double(num bits, double a) {
    const __m512d more = _mm512_set1_pd(a);
    return (num){_mm512_castpd_si512(_mm512_add_pd(_mm512_castsi512_pd(bits.a), more)),
                 _mm512_castpd_si512(_mm512_add_pd(_mm512_castsi512_pd(bits.b), more))};
}

static inline __m512d double_half(__m512i x) {
    return _mm512_cvtepi64_pd(x);
}

// The bits of the double nearest to a whole number.
static inline num as_double(num x) {
    return (num){_mm512_castpd_si512(double_half(x.a)), _mm512_castpd_si512(double_half(x.b))};
}

static inline mask less(num x, num y) {
    return (mask){_mm512_cmplt_epi64_mask(x.a, y.a), _mm512_cmplt_epi64_mask(x.b, y.b)};
}

static inline mask both(mask x, mask y) {
    return (mask){_kand_mask8(x.a, y.a), _kand_mask8(x.b, y.b)};
}

static inline mask either(mask x, mask y) {
    return (mask){_kor_mask8(x.a, y.a), _kor_mask8(x.b, y.b)};
}

static inline mask but_not(mask x, mask y) {
    return (mask){_kandn_mask8(x.a, y.a), _kandn_mask8(x.b, y.b)};
}

static inline bool any(mask x) {
    return !_kortestz_mask8_u8(x.a, x.b);
}

static inline unsigned bits_of(mask x) {
    return (unsigned)x.a | (unsigned)x.b << 8;
}

static inline num choose(mask m, num yes, num no) {
    return (num){_mm512_mask_blend_epi64(m.a, no.a, yes.a),
                 _mm512_mask_blend_epi64(m.b, no.b, yes.b)};
}

static inline num look_up(const int64_t *table, num at) {
    return (num){_mm512_i64gather_epi64(at.a, table, 8), _mm512_i64gather_epi64(at.b, table, 8)};
}

static inline mask bit_set(num x, int k) {
    const __m512i bit = _mm512_set1_epi64(INT64_C(1) << k);
    return (mask){_mm512_test_epi64_mask(x.a, bit), _mm512_test_epi64_mask(x.b, bit)};
}

static inline void unload_wide(num x, double scale, double to[LANES]) {
    const __m512d by = _mm512_set1_pd(scale);
    _mm512_storeu_pd(to, double_half(x.a) * by);
    _mm512_storeu_pd(to + 8, double_half(x.b) * by);
}

static inline void unload(num x, double scale, float to[LANES]) {
    const __m512d by = _mm512_set1_pd(scale);
    _mm256_storeu_ps(to, _mm512_cvtpd_ps(double_half(x.a) * by));
    _mm256_storeu_ps(to + 8, _mm512_cvtpd_ps(double_half(x.b) * by));
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
