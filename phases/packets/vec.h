// Vectors of rays at once: three reals, structure of arrays; log and exp. Written
// once, in lanes.h's words.
//
// gcc's and clang's operators are used for + − × ÷; fused multiply-adds are written out, since contraction is
// off.
#ifndef PACKETS_VEC_H
#define PACKETS_VEC_H

#include "lanes.h"

struct vec {
    real x, y, z;
};

static inline struct vec vec_set(const float *a) {
    return (struct vec){set(a[0]), set(a[1]), set(a[2])};
}

static inline struct vec vec_doubles(const double a[3]) {
    return (struct vec){set((float)a[0]), set((float)a[1]), set((float)a[2])};
}

static inline real vec_dot(struct vec a, struct vec b) {
    return mul_add(a.x, b.x, mul_add(a.y, b.y, a.z * b.z));
}

static inline real vec_norm(struct vec a) {
    return root(vec_dot(a, a));
}

static inline struct vec vec_scale(struct vec a, real s) {
    return (struct vec){a.x * s, a.y * s, a.z * s};
}

// The points at distance t along the rays.
static inline struct vec vec_along(struct vec origin, struct vec direction, real t) {
    return (struct vec){mul_add(direction.x, t, origin.x), mul_add(direction.y, t, origin.y),
                        mul_add(direction.z, t, origin.z)};
}

static inline struct vec vec_choose(mask m, struct vec yes, struct vec no) {
    return (struct vec){choose(m, yes.x, no.x), choose(m, yes.y, no.y), choose(m, yes.z, no.z)};
}

// d mirrored at the plane with unit normal n.
static inline struct vec vec_reflect(struct vec d, struct vec n) {
    return vec_along(d, n, set(-2.0f) * vec_dot(d, n));
}

// log and exp: range reduction after Cody and Waite, "Software manual for the elementary functions"
// (1980); polynomials by Chebyshev interpolation, derived by scripts/polynomials.py. Errors
// measured over all floats of their ranges by tests/c/test_math_opt4.c.

// log a for normal a > 0. 0 and denormals read as 2^-127·(1 + fraction): finite, not −∞.
static inline real log_of(real a) {
    COUNT(log_of, call);
    real e = exponent_of(a), m = mantissa_of(a);
    mask high = greater(m, set(1.41421356f));
    m = choose(high, m * set(0.5f), m);
    e = e + keep(high, set(1.0f));
    real f = m - set(1.0f), s = f / (m + set(1.0f)), u = s * s;
    real p = mul_add(u, set(0.29579949392f), set(0.39988780566f));
    p = mul_add(u, p, set(0.6666668504f));
    // 2s = f − s·f, and f is exact; ln 2 in two parts, the first exact times e
    real low_part = mul_sub(e, set(-2.12194440e-4f), s * neg_mul_add(u, p, f));
    return mul_add(e, set(0.693359375f), f + low_part);
}

// exp a; below −87 it stays at exp(−87) = 2e-38, above 88 at exp(88).
static inline real exp_of(real a) {
    COUNT(exp_of, call);
    a = least_of(most_of(a, set(-87.0f)), set(88.0f));
    real n = whole_near(a * set(1.44269504f));
    real r = neg_mul_add(n, set(0.693359375f), a);
    r = neg_mul_add(n, set(-2.12194440e-4f), r);
    real p = mul_add(r, set(0.001392617612f), set(0.0083631730745f));
    p = mul_add(r, p, set(0.041666554662f));
    p = mul_add(r, p, set(0.16666577026f));
    p = mul_add(r, p, set(0.5f));
    return scaled(set(1.0f) + mul_add(r * r, p, r), n);
}

// a^b for a > 0: relative error about (2 + |b·ln a|) ulp; 0 gives at most 2^(-127·b).
static inline real power_of(real a, real b) {
    COUNT(power_of, call);
    return exp_of(b * log_of(a));
}

#endif
