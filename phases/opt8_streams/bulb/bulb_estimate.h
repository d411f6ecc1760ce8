// A Mandelbulb's distance estimate. D. White and P. Nylander's power-8 map with the running derivative (I. Quilez,
// "mandelbulb", iquilezles.org/articles/mandelbulb), as three squarings of two unit phasors: (ρ + iy)⁸ and (x +
// iz)⁸/ρ⁸, ρ² = x² + z². It needs no division and no exact root. The derivative's root and quotient only scale the
// estimate and have 14 bits: the surface stays where it is, and a step's length errs by 2⁻¹³ of itself.
#pragma once

#include "core/numerics.h"
#include "core/prepared.h"

// A point's orbit. The derivative is slope·√product, with the product of all earlier m. Its recursion,
// 8·m³·√m·derivative + 1, becomes 8·m³·slope + 1/√product. Only the small summand has a root, so 11 bits are enough,
// except in the first two iterations of a camera ray (`exact`).
struct scaled_orbit {
    vfloat x, y, z, flat, m; // flat: x² + z², m: |·|²
    vfloat slope, product;
    vmask on, far; // on: have not escaped
};

static inline void bulb_square(struct scaled_orbit *b, vfloat *m) {
    b->flat = v_madd(b->x, b->x, v_madd(b->z, b->z, v_splat(1e-30f)));
    *m = v_madd(b->y, b->y, b->flat);
}

// Writes to `b`. A returned struct would be copied in halves, and loads would wait for the stores.
static inline void bulb_begin(struct scaled_orbit *b, struct vec p, vmask live) {
    b->x = p.x;
    b->y = p.y;
    b->z = p.z;
    b->product = b->slope = v_splat(1.0f);
    bulb_square(b, &b->m);
    b->far = v_cmp_gt(b->m, v_splat(1024.0f));
    b->on = v_andnot(b->far, live);
}

// Points in double, and the derivative there.
struct orbit_double {
    vhalf x, y, z, slope;
};

// Returns the first iteration, to 40 bits. Its rounding error in float, and the point's, decide where a march in float
// ends. The errors of later iterations count an eighth or less of those before.
static inline struct orbit_double bulb_first(vhalf x, vhalf y, vhalf z) {
    vhalf one = v_half_splat(1.0), two = v_half_splat(2.0);
    vhalf k3 = v_half_madd(x, x, v_half_madd(z, z, v_half_splat(1e-30)));
    vhalf k4 = v_half_nmadd(y, y, k3);
    vhalf r = v_half_rsqrt_approx(k3), h = k3 * r, error = v_half_nmadd(h, r, one);
    vhalf more = error * v_half_madd(error, v_half_splat(0.375), v_half_splat(0.5));
    vhalf rho = v_half_madd(h, more, h), per = v_half_madd(r, more, r);
    vhalf b2 = (rho + rho) * y, k1 = v_half_nmadd(b2, b2, k4 * k4);
    vhalf q = (k4 + k4) * b2, k = k1 * q, z4 = z * ((per + per) * (per + per));
    vhalf sin2 = x * z4, cos2 = v_half_nmadd(z, z4, two);
    vhalf cos4 = v_half_nmadd(sin2, sin2, two), sin4 = sin2 * cos2, k_sin4 = k * sin4;
    vhalf m = v_half_madd(y, y, k3), s = v_half_rsqrt_approx(m), root = m * s;
    vhalf twelve = v_half_madd(v_half_nmadd(root, s, one), v_half_splat(6.0), v_half_splat(12.0));
    return (struct orbit_double){v_half_madd(k_sin4, cos4, x),
                                 v_half_madd(k1, k1, v_half_nmadd(q, q, y)),
                                 v_half_madd(k_sin4, sin4, v_half_nmadd(k, two, z)),
                                 v_half_madd((m * m) * m, root * twelve, one)};
}

// Ends an iteration, for points that had not escaped before.
static inline void bulb_grow(struct scaled_orbit *b, vfloat bailout) {
    vfloat grown;
    bulb_square(b, &grown);
    b->m = v_select(b->on, grown, b->m);
    b->on = v_cmp_ngt_in(b->on, grown, bailout);
}

// Returns 1/√a for the derivative's sum.
static inline vfloat derivative_root(vfloat a, bool exact) {
    return exact ? v_rsqrt_newton(a) : v_rsqrt_approx(a);
}

// Takes an iteration. With A = ρ² − y², (ρ + iy)⁴ has the real part R = 2·A² − m², (ρ + iy)⁸ has 2·R² − m⁴ and
// 8·ρ·y·A·R. The phasor (x + iz)²/ρ² is halved and its square in eighths, so k is 128 times its factor.
static inline void bulb_step(struct scaled_orbit *b, struct vec p, int i, int first, bool exact,
                             vfloat bailout) {
    ACTIVE(v_count(b->on));
    COUNT(bulb_step, call);
    vfloat x = b->x, y = b->y, z = b->z, m = b->m, square = m * m, r, per;
    if (i == 0) {
        b->product = m;
        b->slope = v_madd(square * v_splat(12.0f), m, derivative_root(m, exact));
    } else {
        if (i ==
            first) // for points that escaped before `first` the estimate is √m too short, which is safe
            b->product = m;
        else
            b->product = v_madd_where(b->on, b->product, m, v_splat(0.0f));
        b->slope = v_madd_where(b->on, b->slope, square * v_splat(8.0f) * m,
                                derivative_root(b->product, exact && i <= 1));
    }
    vfloat a = v_nmadd(y, y, b->flat), k1 = v_msub(v_splat(2.0f), a * a, square);
    vfloat k = (a * k1) * (y * root_and_inverse(b->flat, 1024.0f, &r, &per));
    vfloat z1 = (z * r) * per, sin2 = x * z1, cos2 = v_nmadd(z, z1, v_splat(0.5f));
    vfloat cos4 = v_nmadd(sin2, sin2, v_splat(0.125f)), sin4 = sin2 * cos2, k_sin4 = k * sin4;
    b->x = v_madd(k_sin4, cos4, p.x);
    b->z = v_madd(k_sin4, sin4, v_nmadd(k, v_splat(1.0f / 128.0f), p.z));
    b->y = v_madd(v_splat(2.0f), k1 * k1, v_nmadd(square, square, p.y));
    bulb_grow(b, bailout);
}

// Returns ¼·ln a to 5e-7. Its error at a = 1, over the derivative, is that of the surface's place.
static inline vfloat rough_log(vfloat a) {
    vfloat e, f = v_mantissa_near_1(a, &e) - v_splat(1.0f);
    vfloat p =
        v_madd(f, v_splat(0.25f * -0.10063060373067856f), v_splat(0.25f * 0.202902689576149f));
    p = v_madd(f, p, v_splat(0.25f * -0.25720563530921936f));
    p = v_madd(f, p, v_splat(0.25f * 0.33385127782821655f));
    p = v_madd(f, p, v_splat(0.25f * -0.4998246431350708f));
    p = v_madd(f, p, v_splat(0.25f * 0.999990701675415f));
    return v_madd(f, p, e * v_splat(0.25f * 0.69314718056f));
}

// Returns the estimate. `tiny` keeps differences near the centre, where the product of m and `product` underflows;
// without it the estimate is 0 there.
static inline vfloat bulb_end(const struct scaled_orbit *b, struct vec p, bool tiny) {
    vfloat all = b->m * b->product, root_of_both; // ¼·√m/dz·ln m, √m/√product = m/√all
    if (tiny) {
        root_of_both = v_rsqrt_newton(b->m) * v_rsqrt_newton(b->product);
        all = b->product;
    } else {
        root_of_both = v_rsqrt_newton(all);
    }
    vfloat distance = b->m * root_of_both * rough_inverse(b->slope) * rough_log(b->m);
    distance = v_select_or_zero(v_cmp_gt(all, v_splat(0x1p-124f)),
                                distance); // 0/0 at the centre, which is inside
    if (v_any(b->far)) {
        vfloat square = vec_dot(p, p), r = v_sqrt(square);
        distance = v_select(b->far, r * v_log(r) * v_splat(1.0f / 3.0f), distance);
    }
    return distance;
}

enum { INTERLEAVED = 3 }; // packets of camera rays

// Iterates `count` packets from iteration `first` on, and sets their distances. `soon`: all may escape after one
// iteration.
__attribute__((always_inline)) static inline void bulbs_end(const struct primitive *s, int first,
                                                            bool soon, bool exact, bool tiny,
                                                            int count, struct scaled_orbit *b,
                                                            const struct vec *p, vfloat *distance) {
    vfloat bailout = v_splat(s->bailout);
    for (int i = first; i < s->iterations; i++) {
        for (int k = 0; k < count; k++)
            bulb_step(&b[k], p[k], i, first, exact, bailout);
        if (soon || i % 2 == 1) {
            vmask on = b[0].on;
            for (int k = 1; k < count; k++)
                on = v_or(on, b[k].on);
            if (!v_any(on))
                break;
        }
    }
    for (int k = 0; k < count; k++)
        distance[k] = bulb_end(&b[k], p[k], tiny);
}

__attribute__((always_inline)) static inline void bulbs(const struct primitive *s,
                                                        const struct vec *p, const vmask *done,
                                                        bool soon, bool exact, vfloat *distance) {
    struct scaled_orbit b[INTERLEAVED];
    for (int k = 0; k < INTERLEAVED; k++)
        bulb_begin(&b[k], p[k], v_not(done[k]));
    bulbs_end(s, 0, soon, exact, false, INTERLEAVED, b, p, distance);
}
