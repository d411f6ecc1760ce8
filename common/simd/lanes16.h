// Sixteen lanes: AVX-512 F and DQ. See simd.h.
#pragma once

typedef __m512 vfloat;
typedef __m512d vhalf; // doubles for half of the lanes
typedef struct {
    __mmask16 bits; // a bit for each lane
} vmask;
typedef __m512i vindex; // a whole number in each lane

#define MM(name) _mm512_##name
#define BITS(a) _mm512_castps_si512(a)
#define FLOATS(a) _mm512_castsi512_ps(a)
#define BITS_AND _mm512_and_si512
#define BITS_OR _mm512_or_si512
#define COMPARED(name, predicate) _mm512_cmp_ps_mask(a, b, predicate)
#define COMPARED_IN(name, predicate) _mm512_mask_cmp_ps_mask(m.bits, a, b, predicate)
#include "simd/words.h"

static inline vfloat v_iota(void) {
    return _mm512_setr_ps(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}

static inline vmask v_signbit(vfloat a) {
    return (vmask){_mm512_movepi32_mask(_mm512_castps_si512(a))};
}

static inline vmask v_mask_none(void) {
    return (vmask){0};
}

static inline vmask v_mask_all(void) {
    return (vmask){0xffff};
}

static inline vmask v_mask_of_bits(unsigned which) {
    return (vmask){(__mmask16)which};
}

static inline unsigned v_mask_bits(vmask a) {
    return a.bits;
}

static inline vmask v_and(vmask a, vmask b) {
    return (vmask){a.bits & b.bits};
}

static inline vmask v_or(vmask a, vmask b) {
    return (vmask){a.bits | b.bits};
}

static inline vmask v_andnot(vmask a, vmask b) {
    return (vmask){_kandn_mask16(a.bits, b.bits)};
}

static inline vfloat v_select(vmask m, vfloat yes, vfloat no) {
    return _mm512_mask_blend_ps(m.bits, no, yes);
}

static inline vfloat v_select_or_zero(vmask m, vfloat a) {
    return _mm512_maskz_mov_ps(m.bits, a);
}

static inline vfloat v_zero_where(vmask m, vfloat a) {
    return _mm512_maskz_mov_ps(_knot_mask16(m.bits), a);
}

static inline vfloat v_negate_where(vmask m, vfloat a) {
    return _mm512_mask_xor_ps(a, m.bits, a, v_splat(-0.0f));
}

static inline vfloat v_add_where(vmask m, vfloat a, vfloat b) {
    return _mm512_mask_add_ps(a, m.bits, a, b);
}

static inline vfloat v_madd_where(vmask m, vfloat a, vfloat b, vfloat c) {
    return _mm512_mask_fmadd_ps(a, m.bits, b, c);
}

static inline float v_reduce_min(vfloat a) {
    return _mm512_reduce_min_ps(a);
}

static inline float v_reduce_max(vfloat a) {
    return _mm512_reduce_max_ps(a);
}

static inline vfloat v_max_of_lanes(vfloat a) {
    return v_splat(_mm512_reduce_max_ps(a));
}

static inline vfloat v_rsqrt_approx(vfloat a) {
    return _mm512_rsqrt14_ps(a);
}

static inline vfloat v_rcp_approx(vfloat a) {
    return _mm512_rcp14_ps(a);
}

static inline vfloat v_round(vfloat a) {
    return _mm512_roundscale_ps(a, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
}

static inline vfloat v_mantissa_near_1(vfloat a, vfloat *exponent) {
    *exponent = _mm512_getexp_ps(a * v_splat(4.0f / 3.0f));
    return _mm512_getmant_ps(a, _MM_MANT_NORM_p75_1p5, _MM_MANT_SIGN_src);
}

static inline vhalf v_half_rsqrt_approx(vhalf a) {
    return _mm512_rsqrt14_pd(a);
}

static inline vhalf v_half_low(vfloat a) {
    return _mm512_cvtps_pd(_mm512_castps512_ps256(a));
}

static inline vhalf v_half_high(vfloat a) {
    return _mm512_cvtps_pd(_mm512_extractf32x8_ps(a, 1));
}

static inline vfloat v_from_halves(vhalf low, vhalf high) {
    return _mm512_insertf32x8(_mm512_castps256_ps512(_mm512_cvtpd_ps(low)), _mm512_cvtpd_ps(high),
                              1);
}
