// A reduction, and approximate roots and quotients, with their costs.
#pragma once

#include "simd/simd.h"

static inline float most_lane(vfloat x) {
    return -v_reduce_min(v_splat(0.0f) - x);
}

// Returns the lowest `count` bits that are set.
static inline unsigned lowest_bits(unsigned bits, int count) {
    unsigned rest = bits;
    for (int i = 0; i < count; i++)
        rest &= rest - 1;
    return bits & ~rest;
}

// Returns 1/√a for normal a > 0, to an ulp or two.
static inline vfloat inverse_root(vfloat a) {
#if LANES == 16
    return v_rsqrt_newton(a);
#else
    return v_splat(1.0f) / v_sqrt(a);
#endif
}

#if LANES == 16
// Returns 2·times/(√a·b) for normal a > 0 and b. One Newton step corrects both approximations. Multiplied by
// `times` first, because 1/(√a·b) alone may be denormal.
static inline vfloat twice_over_root(vfloat times, vfloat a, vfloat b) {
    vfloat r = v_rsqrt_approx(a), per = v_rcp_approx(b), part = times * r * per;
    vfloat off = v_nmadd(a * r, r, v_splat(1.0f)), off_b = v_nmadd(b, per, v_splat(1.0f));
    return v_madd(part, off + (off_b + off_b), part + part);
}

// √a of a normal a > 0 and its inverse, both to 14 bits; off = 1 − a·inverse², for one Newton step.
struct rooted {
    vfloat inverse, root, off;
};

static inline struct rooted rooted(vfloat a) {
    vfloat r = v_rsqrt_approx(a), h = a * r;
    return (struct rooted){r, h, v_nmadd(h, r, v_splat(1.0f))};
}

// Returns 2·b·√a to an ulp or two. Sums replace products where both would do: Zen has separate units for them.
static inline vfloat twice_root_times(const struct rooted *a, vfloat b) {
    vfloat part = b * a->root;
    return v_madd(part, a->off, part + part);
}

// Returns b/a to an ulp or two. 1/a itself may be denormal.
static inline vfloat divided_by(vfloat b, const struct rooted *a) {
    vfloat part = b * a->inverse * a->inverse;
    return v_madd(part, a->off, part);
}
#else
// Returns 2·times/(√a·b) for normal a > 0 and b: one Newton step each.
static inline vfloat twice_over_root(vfloat times, vfloat a, vfloat b) {
    vfloat per = v_rcp_approx(b);
    per = per * v_nmadd(b, per, v_splat(2.0f));
    return (times + times) * v_rsqrt_newton(a) * per;
}

// √a of a normal a > 0 and its inverse, to a few ulp. Two values only: AVX2 has 16 registers.
struct rooted {
    vfloat inverse, root;
};

static inline struct rooted rooted(vfloat a) {
    vfloat r = v_rsqrt_newton(a);
    return (struct rooted){r, a * r};
}

// Returns 2·b·√a.
static inline vfloat twice_root_times(const struct rooted *a, vfloat b) {
    return (b + b) * a->root;
}

// Returns b/a. 1/a itself may be denormal.
static inline vfloat divided_by(vfloat b, const struct rooted *a) {
    return b * a->inverse * a->inverse;
}
#endif
