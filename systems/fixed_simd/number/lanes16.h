// Sixteen lanes: two AVX-512 registers (F and DQ) of eight 64-bit lanes. Included by lanes.h.
#ifndef FIXED_LANES16_H
#define FIXED_LANES16_H

#include <immintrin.h>
#include <string.h>

typedef struct {
    __m512i a, b;
} vnum;

typedef struct {
    __mmask8 a, b;
} vmask;

static inline vnum v_splat(int64_t a) {
    return (vnum){_mm512_set1_epi64(a), _mm512_set1_epi64(a)};
}

static inline vnum v_iota(void) {
    return (vnum){_mm512_setr_epi64(0, 1, 2, 3, 4, 5, 6, 7),
                  _mm512_setr_epi64(8, 9, 10, 11, 12, 13, 14, 15)};
}

static inline vnum v_load(const int64_t from[LANES]) {
    return (vnum){_mm512_loadu_si512(from), _mm512_loadu_si512(from + LANES / 2)};
}

static inline vnum v_add(vnum x, vnum y) {
    return (vnum){_mm512_add_epi64(x.a, y.a), _mm512_add_epi64(x.b, y.b)};
}

static inline vnum v_sub(vnum x, vnum y) {
    return (vnum){_mm512_sub_epi64(x.a, y.a), _mm512_sub_epi64(x.b, y.b)};
}

static inline vnum v_mul_wide(vnum x, vnum y) {
    return (vnum){_mm512_mul_epi32(x.a, y.a), _mm512_mul_epi32(x.b, y.b)};
}

static inline vnum v_and_bits(vnum x, vnum y) {
    return (vnum){_mm512_and_si512(x.a, y.a), _mm512_and_si512(x.b, y.b)};
}

static inline vnum v_or_bits(vnum x, vnum y) {
    return (vnum){_mm512_or_si512(x.a, y.a), _mm512_or_si512(x.b, y.b)};
}

// v_sra, v_srav keep the sign; the other shifts move bits. By more than 63 bits or less than 0 nothing is left.
static inline vnum v_sra(vnum x, int by) {
    const __m512i n = _mm512_set1_epi64(by);
    return (vnum){_mm512_srav_epi64(x.a, n), _mm512_srav_epi64(x.b, n)};
}

static inline vnum v_srav(vnum x, vnum y) {
    return (vnum){_mm512_srav_epi64(x.a, y.a), _mm512_srav_epi64(x.b, y.b)};
}

static inline vnum v_sll(vnum x, int by) {
    const __m512i n = _mm512_set1_epi64(by);
    return (vnum){_mm512_sllv_epi64(x.a, n), _mm512_sllv_epi64(x.b, n)};
}

static inline vnum v_srl(vnum x, int by) {
    const __m512i n = _mm512_set1_epi64(by);
    return (vnum){_mm512_srlv_epi64(x.a, n), _mm512_srlv_epi64(x.b, n)};
}

static inline vnum v_sllv(vnum x, vnum y) {
    return (vnum){_mm512_sllv_epi64(x.a, y.a), _mm512_sllv_epi64(x.b, y.b)};
}

static inline vnum v_srlv(vnum x, vnum y) {
    return (vnum){_mm512_srlv_epi64(x.a, y.a), _mm512_srlv_epi64(x.b, y.b)};
}

// Adds `a` to the float in the lower 32 bits of each lane; the upper 32 bits are 0 before and after.
static inline vnum v_add_float(vnum bits, float a) {
    uint32_t low;
    memcpy(&low, &a, sizeof low);
    const __m512 more = _mm512_castsi512_ps(_mm512_set1_epi64(low));
    return (vnum){_mm512_castps_si512(_mm512_add_ps(_mm512_castsi512_ps(bits.a), more)),
                  _mm512_castps_si512(_mm512_add_ps(_mm512_castsi512_ps(bits.b), more))};
}

static inline vnum v_add_double(vnum bits, double a) {
    const __m512d more = _mm512_set1_pd(a);
    return (vnum){_mm512_castpd_si512(_mm512_add_pd(_mm512_castsi512_pd(bits.a), more)),
                  _mm512_castpd_si512(_mm512_add_pd(_mm512_castsi512_pd(bits.b), more))};
}

static inline __m512d double_half(__m512i x) {
    return _mm512_cvtepi64_pd(x);
}

// Returns the bits of the double nearest to an integer.
static inline vnum v_double_bits(vnum x) {
    return (vnum){_mm512_castpd_si512(double_half(x.a)), _mm512_castpd_si512(double_half(x.b))};
}

static inline vmask v_cmp_lt(vnum x, vnum y) {
    return (vmask){_mm512_cmplt_epi64_mask(x.a, y.a), _mm512_cmplt_epi64_mask(x.b, y.b)};
}

static inline vmask v_and(vmask x, vmask y) {
    return (vmask){_kand_mask8(x.a, y.a), _kand_mask8(x.b, y.b)};
}

static inline vmask v_or(vmask x, vmask y) {
    return (vmask){_kor_mask8(x.a, y.a), _kor_mask8(x.b, y.b)};
}

static inline vmask v_andnot(vmask x, vmask y) {
    return (vmask){_kandn_mask8(x.a, y.a), _kandn_mask8(x.b, y.b)};
}

static inline bool v_any(vmask x) {
    return !_kortestz_mask8_u8(x.a, x.b);
}

static inline unsigned v_mask_bits(vmask x) {
    return (unsigned)x.a | (unsigned)x.b << 8;
}

static inline vnum v_select(vmask m, vnum yes, vnum no) {
    return (vnum){_mm512_mask_blend_epi64(m.a, no.a, yes.a),
                  _mm512_mask_blend_epi64(m.b, no.b, yes.b)};
}

static inline vnum v_lookup(const int64_t *table, vnum at) {
    return (vnum){_mm512_i64gather_epi64(at.a, table, 8), _mm512_i64gather_epi64(at.b, table, 8)};
}

static inline vmask v_test_bit(vnum x, int k) {
    const __m512i bit = _mm512_set1_epi64(INT64_C(1) << k);
    return (vmask){_mm512_test_epi64_mask(x.a, bit), _mm512_test_epi64_mask(x.b, bit)};
}

static inline void v_store_double(vnum x, double scale, double to[LANES]) {
    const __m512d by = _mm512_set1_pd(scale);
    _mm512_storeu_pd(to, double_half(x.a) * by);
    _mm512_storeu_pd(to + 8, double_half(x.b) * by);
}

static inline void v_store_float(vnum x, double scale, float to[LANES]) {
    const __m512d by = _mm512_set1_pd(scale);
    _mm256_storeu_ps(to, _mm512_cvtpd_ps(double_half(x.a) * by));
    _mm256_storeu_ps(to + 8, _mm512_cvtpd_ps(double_half(x.b) * by));
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
