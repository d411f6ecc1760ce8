// Vectors of several rays at once: three vfloats, a structure of arrays. Fused multiply-adds are written out,
// because contraction is off (-ffp-contract=off). Part of simd.h.
#pragma once

typedef float real;
typedef vfloat vreal;
#include "simd/vec.h"

static inline struct vec vec_set(const float *a) {
    return (struct vec){v_splat(a[0]), v_splat(a[1]), v_splat(a[2])};
}

static inline struct vec vec_from_doubles(const double a[3]) {
    return (struct vec){v_splat((float)a[0]), v_splat((float)a[1]), v_splat((float)a[2])};
}

static inline struct vec vec_sub(struct vec a, struct vec b) {
    return (struct vec){a.x - b.x, a.y - b.y, a.z - b.z};
}

#if LANES > 4

static inline struct point point_select(vmask m, struct point yes, struct point no) {
    return (struct point){vec_select(m, yes.hi, no.hi), vec_select(m, yes.lo, no.lo)};
}

// The point at distance t + dt along the ray, dt small beside t: exact to 2^-43 of the larger of the
// origin's coordinate and t, as long as dt is below 2^-19 of t.
static inline struct point point_at(struct point origin, struct vec direction, vfloat t,
                                    vfloat dt) {
    struct point p = origin;
    p.hi.x = point_along(p.hi.x, &p.lo.x, direction.x, t, dt);
    p.hi.y = point_along(p.hi.y, &p.lo.y, direction.y, t, dt);
    p.hi.z = point_along(p.hi.z, &p.lo.z, direction.z, t, dt);
    return p;
}

// a − b, rounded once to float: exact to an ulp of the *difference*.
static inline struct vec point_sub(struct point a, const float hi[3], const float lo[3]) {
    return (struct vec){(a.hi.x - v_splat(hi[0])) + (a.lo.x - v_splat(lo[0])),
                        (a.hi.y - v_splat(hi[1])) + (a.lo.y - v_splat(lo[1])),
                        (a.hi.z - v_splat(hi[2])) + (a.lo.z - v_splat(lo[2]))};
}

// A double in each lane: for what is computed once per ray, where float would lose the difference of two points.
typedef struct {
    vhalf low, high;
} vdouble;

struct vec_double {
    vdouble x, y, z;
};

static inline vdouble v_double_sum(vfloat hi, vfloat lo) {
    return (vdouble){v_half_low(hi) + v_half_low(lo), v_half_high(hi) + v_half_high(lo)};
}

static inline struct vec_double vec_double_of(struct point p) {
    return (struct vec_double){v_double_sum(p.hi.x, p.lo.x), v_double_sum(p.hi.y, p.lo.y),
                               v_double_sum(p.hi.z, p.lo.z)};
}

static inline vdouble v_double_sub(vdouble a, double b) {
    vhalf each = v_half_splat(b);
    return (vdouble){a.low - each, a.high - each};
}

static inline struct vec_double vec_double_sub(struct vec_double a, const double b[3]) {
    return (struct vec_double){v_double_sub(a.x, b[0]), v_double_sub(a.y, b[1]),
                               v_double_sub(a.z, b[2])};
}

static inline vdouble v_double_mul(vdouble a, double b) {
    vhalf each = v_half_splat(b);
    return (vdouble){a.low * each, a.high * each};
}

static inline vdouble v_double_madd(vdouble a, double b, vdouble c) {
    vhalf each = v_half_splat(b);
    return (vdouble){v_half_madd(a.low, each, c.low), v_half_madd(a.high, each, c.high)};
}

static inline vdouble v_double_plus(vdouble a, vdouble b) {
    return (vdouble){a.low + b.low, a.high + b.high};
}

static inline vdouble v_double_minus(vdouble a, vdouble b) {
    return (vdouble){a.low - b.low, a.high - b.high};
}

static inline vdouble v_double_along(vdouble origin, vdouble direction, vdouble t) {
    return (vdouble){v_half_madd(direction.low, t.low, origin.low),
                     v_half_madd(direction.high, t.high, origin.high)};
}

static inline vdouble v_double_times(vdouble a, vdouble b) {
    return (vdouble){a.low * b.low, a.high * b.high};
}

static inline vdouble v_double_product(struct vec_double a, struct vec_double b) {
    return v_double_along(v_double_along(v_double_times(a.x, b.x), a.y, b.y), a.z, b.z);
}

static inline vdouble v_double_floor(vdouble a) {
    return (vdouble){v_half_floor(a.low), v_half_floor(a.high)};
}

static inline vdouble v_double_dot(struct vec_double a, const double b[3]) {
    return v_double_madd(a.x, b[0], v_double_madd(a.y, b[1], v_double_mul(a.z, b[2])));
}

// Returns ahead + x·right + y·up at unit length: a camera's direction.
static inline struct vec_double v_double_look(vdouble x, vdouble y, const double ahead[3],
                                              const double right[3], const double up[3]) {
    vdouble d[3];
    vhalf one = v_half_splat(1.0), low = v_half_splat(0.0), high = low;
    for (int i = 0; i < 3; i++) {
        d[i] = v_double_madd(x, right[i], v_double_mul(y, up[i]));
        d[i] = v_double_sub(d[i], -ahead[i]);
        low = v_half_madd(d[i].low, d[i].low, low);
        high = v_half_madd(d[i].high, d[i].high, high);
    }
    vdouble per = {one / v_half_sqrt(low), one / v_half_sqrt(high)};
    return (struct vec_double){v_double_times(d[0], per), v_double_times(d[1], per),
                               v_double_times(d[2], per)};
}

static inline vfloat v_double_to_float(vdouble a) {
    return v_from_halves(a.low, a.high);
}

// What is left of a beside the float `near`.
static inline vfloat v_double_residual(vdouble a, vfloat near) {
    return v_double_to_float((vdouble){a.low - v_half_low(near), a.high - v_half_high(near)});
}

#endif
