// The words of AVX2 for the lanes of one register: four doubles in opt3, eight floats in opt4. A condition is a mask.
// Included by the phase's vec.h: its are real, vreal, LANES and AVX(name), the intrinsic of that name.
//
// + - * / on vreal are the compiler's operators. Fused multiply-adds are written out, because
// contraction is off (-ffp-contract=off).
#pragma once

#include <stdbool.h>

typedef struct {
    vreal bits; // all bits of a lane set, or none
} vmask;

static inline vreal v_splat(real a) {
    return AVX(set1)(a);
}

static inline vreal v_load(const real from[]) {
    return AVX(loadu)(from);
}

static inline void v_store(vreal a, real to[]) {
    AVX(storeu)(to, a);
}

// Ordered comparisons: false where an operand is NaN.
static inline vmask v_cmp_lt(vreal a, vreal b) {
    return (vmask){AVX(cmp)(a, b, _CMP_LT_OQ)};
}

static inline vmask v_cmp_gt(vreal a, vreal b) {
    return (vmask){AVX(cmp)(a, b, _CMP_GT_OQ)};
}

static inline vmask v_mask_none(void) {
    return (vmask){AVX(setzero)()};
}

static inline vmask v_and(vmask a, vmask b) {
    return (vmask){AVX (and)(a.bits, b.bits)};
}

static inline vmask v_or(vmask a, vmask b) {
    return (vmask){AVX(or)(a.bits, b.bits)};
}

// b where not a.
static inline vmask v_andnot(vmask a, vmask b) {
    return (vmask){AVX(andnot)(a.bits, b.bits)};
}

static inline vmask v_not(vmask a) {
    vreal all = AVX(castsi256)(_mm256_set1_epi32(-1));
    return (vmask){AVX(xor)(a.bits, all)};
}

// Bit i is lane i.
static inline unsigned v_mask_bits(vmask a) {
    return (unsigned)AVX(movemask)(a.bits);
}

static inline bool v_any(vmask a) {
    return v_mask_bits(a) != 0;
}

static inline bool v_all(vmask a) {
    return v_mask_bits(a) == (1u << LANES) - 1;
}

// The number of lanes in a mask. Only counting builds call it.
static inline int v_count(vmask a) {
    return __builtin_popcount(v_mask_bits(a));
}

static inline vreal v_select(vmask m, vreal yes, vreal no) {
    return AVX(blendv)(no, yes, m.bits);
}

static inline vreal v_select_or_zero(vmask m, vreal a) {
    return AVX (and)(a, m.bits);
}

static inline vreal v_zero_where(vmask m, vreal a) {
    return AVX(andnot)(m.bits, a);
}

static inline vreal v_min(vreal a, vreal b) {
    return AVX(min)(a, b);
}

static inline vreal v_max(vreal a, vreal b) {
    return AVX(max)(a, b);
}

static inline vreal v_abs(vreal a) { // clears the sign bit
    return AVX(andnot)(v_splat(-0.0), a);
}

static inline vreal v_floor(vreal a) {
    return AVX(floor)(a);
}

// The lanes where both numbers have their sign bit set. Only the sign bits of this mask are valid:
// it is for v_negate_where alone.
static inline vmask v_both_negative(vreal a, vreal b) {
    return (vmask){AVX (and)(a, b)};
}

static inline vreal v_negate_where(vmask m, vreal a) {
    vreal sign = AVX (and)(m.bits, v_splat(-0.0));
    return AVX(xor)(a, sign);
}

// a·b + c, rounded once; v_nmadd: c − a·b; v_msub: a·b − c.
static inline vreal v_madd(vreal a, vreal b, vreal c) {
    return AVX(fmadd)(a, b, c);
}

static inline vreal v_nmadd(vreal a, vreal b, vreal c) {
    return AVX(fnmadd)(a, b, c);
}

static inline vreal v_msub(vreal a, vreal b, vreal c) {
    return AVX(fmsub)(a, b, c);
}
