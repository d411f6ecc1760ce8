// The lanes of the build at hand: tile.c is built for 8 and for 16 (phase.json). number.h says what each operation is.
// Eight lanes are two AVX2 registers of four 64-bit lanes, sixteen two AVX-512 registers (F and DQ) of eight.
#pragma once

#include <immintrin.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#if LANES == 16
#define OP(name) _mm512_##name
#define BITS(name) _mm512_##name##_si512
#define set1_bits _mm512_set1_epi64
#define AS_FLOATS _mm512_castsi512_ps
#define AS_DOUBLES _mm512_castsi512_pd
typedef __m512i half_num;
typedef __m512d half_double;
typedef __mmask8 half_mask;
#define and_mask _kand_mask8
#define or_mask _kor_mask8
#define andnot_mask _kandn_mask8
#elif LANES == 8
#define OP(name) _mm256_##name
#define BITS(name) _mm256_##name##_si256
#define set1_bits _mm256_set1_epi64x
#define AS_FLOATS _mm256_castsi256_ps
#define AS_DOUBLES _mm256_castsi256_pd
typedef __m256i half_num;
typedef __m256d half_double;
typedef __m256i half_mask; // all bits of a lane, or none
#define and_mask _mm256_and_si256
#define or_mask _mm256_or_si256
#define andnot_mask _mm256_andnot_si256
#else
#error "LANES: 8 or 16; common/rules.mk sets it for the files of each_variant in phase.json"
#endif

typedef struct {
    half_num a, b;
} vnum;

typedef struct {
    half_mask a, b;
} vmask;

// An operation on both registers.
#define PAIR(op, x, y) {op((x).a, (y).a), op((x).b, (y).b)}

// What only one of the two instruction sets has.
#if LANES == 16
#define sra_half _mm512_srav_epi64
#define double_half _mm512_cvtepi64_pd
#define lt_half _mm512_cmplt_epi64_mask

static inline half_num select_half(half_mask m, half_num yes, half_num no) {
    return _mm512_mask_blend_epi64(m, no, yes);
}

static inline half_num lookup_half(const int64_t *table, half_num at) {
    return _mm512_i64gather_epi64(at, table, 8);
}

static inline void store_float_half(float to[8], half_double x) {
    _mm256_storeu_ps(to, _mm512_cvtpd_ps(x));
}

static inline bool v_any(vmask x) {
    return !_kortestz_mask8_u8(x.a, x.b);
}

static inline unsigned v_mask_bits(vmask x) {
    return (unsigned)x.a | (unsigned)x.b << 8;
}

static inline vmask v_test_bit(vnum x, int k) {
    const half_num bit = set1_bits(INT64_C(1) << k);
    return (vmask){_mm512_test_epi64_mask(x.a, bit), _mm512_test_epi64_mask(x.b, bit)};
}
#else
// AVX2 has no arithmetic shift of 64 bits. A number between −2^62 and 2^62 is made positive by adding 2^62,
// shifted as bits, and the shifted 2^62 is subtracted: exact.
static inline half_num sra_half(half_num x, half_num by) {
    const half_num up = set1_bits(INT64_C(1) << 62);
    return _mm256_sub_epi64(_mm256_srlv_epi64(_mm256_add_epi64(x, up), by),
                            _mm256_srlv_epi64(up, by));
}

// AVX2 does not convert 64-bit integers to double. The upper half is placed beside the exponent of 2^84, the lower
// one beside that of 2^52. The two offsets, and 2^63 for the sign, are subtracted; the sum is rounded once.
static inline half_double double_half(half_num x) {
    const half_num high_one = set1_bits(0x4530000080000000),
                   low_one = set1_bits(0x4330000000000000);
    half_num high = _mm256_xor_si256(_mm256_srli_epi64(x, 32), high_one);
    half_num low = _mm256_blend_epi16(x, low_one, 0xcc);
    half_double top =
        _mm256_sub_pd(_mm256_castsi256_pd(high), _mm256_set1_pd(0x1p84 + 0x1p63 + 0x1p52));
    return _mm256_add_pd(top, _mm256_castsi256_pd(low));
}

static inline half_mask lt_half(half_num x, half_num y) {
    return _mm256_cmpgt_epi64(y, x);
}

static inline half_num select_half(half_mask m, half_num yes, half_num no) {
    return _mm256_blendv_epi8(no, yes, m);
}

static inline half_num lookup_half(const int64_t *table, half_num at) {
    return _mm256_i64gather_epi64((const long long *)table, at, 8);
}

static inline void store_float_half(float to[4], half_double x) {
    _mm_storeu_ps(to, _mm256_cvtpd_ps(x));
}

static inline bool v_any(vmask x) {
    const half_mask all = _mm256_or_si256(x.a, x.b);
    return !_mm256_testz_si256(all, all);
}

static inline unsigned v_mask_bits(vmask x) {
    int a = _mm256_movemask_pd(_mm256_castsi256_pd(x.a)),
        b = _mm256_movemask_pd(_mm256_castsi256_pd(x.b));
    return (unsigned)(a | b << 4);
}

static inline vmask v_test_bit(vnum x, int k) {
    const half_num bit = set1_bits(INT64_C(1) << k);
    return (vmask){_mm256_cmpeq_epi64(_mm256_and_si256(x.a, bit), bit),
                   _mm256_cmpeq_epi64(_mm256_and_si256(x.b, bit), bit)};
}
#endif

static inline vnum v_splat(int64_t a) {
    return (vnum){set1_bits(a), set1_bits(a)};
}

static inline vnum v_load(const int64_t from[LANES]) {
    return (vnum){BITS(loadu)((const half_num *)from),
                  BITS(loadu)((const half_num *)(from + LANES / 2))};
}

static inline vnum v_iota(void) {
    static const int64_t places[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    return v_load(places);
}

#define ON_BOTH(name, op)                                                                          \
    static inline vnum name(vnum x, vnum y) {                                                      \
        return (vnum)PAIR(op, x, y);                                                               \
    }
ON_BOTH(v_add, OP(add_epi64))
ON_BOTH(v_sub, OP(sub_epi64))
ON_BOTH(v_mul_wide, OP(mul_epi32))
ON_BOTH(v_and_bits, BITS(and))
ON_BOTH(v_or_bits, BITS(or))
// v_sra, v_srav keep the sign; the other shifts move bits. By more than 63 bits or less than 0 nothing is left.
ON_BOTH(v_srav, sra_half)
ON_BOTH(v_sllv, OP(sllv_epi64))
ON_BOTH(v_srlv, OP(srlv_epi64))

static inline vnum v_sra(vnum x, int by) {
    return v_srav(x, v_splat(by));
}

static inline vnum v_sll(vnum x, int by) {
    return v_sllv(x, v_splat(by));
}

static inline vnum v_srl(vnum x, int by) {
    return v_srlv(x, v_splat(by));
}

static inline half_num add_float_half(half_num bits, half_num more) {
    return BITS(castps)(OP(add_ps)(AS_FLOATS(bits), AS_FLOATS(more)));
}

// Adds `a` to the float in the lower 32 bits of each lane; the upper 32 bits are 0 before and after.
static inline vnum v_add_float(vnum bits, float a) {
    uint32_t low;
    memcpy(&low, &a, sizeof low);
    return (vnum)PAIR(add_float_half, bits, v_splat(low));
}

static inline vnum v_add_double(vnum bits, double a) {
    const half_double more = OP(set1_pd)(a);
    return (vnum){BITS(castpd)(OP(add_pd)(AS_DOUBLES(bits.a), more)),
                  BITS(castpd)(OP(add_pd)(AS_DOUBLES(bits.b), more))};
}

// Returns the bits of the double nearest to an integer.
static inline vnum v_double_bits(vnum x) {
    return (vnum){BITS(castpd)(double_half(x.a)), BITS(castpd)(double_half(x.b))};
}

static inline vmask v_cmp_lt(vnum x, vnum y) {
    return (vmask)PAIR(lt_half, x, y);
}

#define ON_BOTH_MASKS(name, op)                                                                    \
    static inline vmask name(vmask x, vmask y) {                                                   \
        return (vmask)PAIR(op, x, y);                                                              \
    }
ON_BOTH_MASKS(v_and, and_mask)
ON_BOTH_MASKS(v_or, or_mask)
ON_BOTH_MASKS(v_andnot, andnot_mask)

static inline vnum v_select(vmask m, vnum yes, vnum no) {
    return (vnum){select_half(m.a, yes.a, no.a), select_half(m.b, yes.b, no.b)};
}

static inline vnum v_lookup(const int64_t *table, vnum at) {
    return (vnum){lookup_half(table, at.a), lookup_half(table, at.b)};
}

static inline void v_store_double(vnum x, double scale, double to[LANES]) {
    const half_double by = OP(set1_pd)(scale);
    OP(storeu_pd)(to, double_half(x.a) * by);
    OP(storeu_pd)(to + LANES / 2, double_half(x.b) * by);
}

static inline void v_store_float(vnum x, double scale, float to[LANES]) {
    const half_double by = OP(set1_pd)(scale);
    store_float_half(to, double_half(x.a) * by);
    store_float_half(to + LANES / 2, double_half(x.b) * by);
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
