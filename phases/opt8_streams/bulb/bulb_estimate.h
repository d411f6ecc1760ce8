// A Mandelbulb's distance estimate. D. White and P. Nylander's power-8 map with the running derivative (I. Quilez,
// "mandelbulb", iquilezles.org/articles/mandelbulb), as three squarings of two unit phasors: (ρ + iy)⁸ and (x +
// iz)⁸/ρ⁸, ρ² = x² + z². It needs no division and no exact root. The derivative's root and quotient only scale the
// estimate and have 14 bits: the surface stays where it is, and a step's length errs by 2⁻¹³ of itself.
#pragma once

#include "core/numerics.h"
#include "core/prepared.h"

enum { INTERLEAVED = 3 }; // packets of camera rays

#include "simd/bulb_orbit.h" // of the names above

// Sets the derivative of the first iteration, of a point that bulb_begin() has set.
static inline void first_slope(struct scaled_orbit *b, bool exact) {
    b->slope = v_madd(b->m * b->m * v_splat(12.0f), b->m, derivative_root(b->m, exact));
    b->product = b->m;
}

// Takes an iteration. With A = ρ² − y², (ρ + iy)⁴ has the real part R = 2·A² − m², (ρ + iy)⁸ has 2·R² − m⁴ and
// 8·ρ·y·A·R. The phasor (x + iz)²/ρ² is halved and its square in eighths, so k is 128 times its factor.
static inline void bulb_step(struct scaled_orbit *b, struct vec p, int i, int first, bool exact,
                             vfloat bailout) {
    (void)first;
    ACTIVE(v_count(b->on));
    COUNT(bulb_step, call);
    vfloat x = b->x, y = b->y, z = b->z, m = b->m, square = m * m, r, per;
    if (i == 0) {
        first_slope(b, exact);
    } else {
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
    vfloat distance = b->m * root_of_both * rough_inverse(b->slope) * rough_log(b->m, 0.25f);
    distance = v_select_or_zero(v_cmp_gt(all, v_splat(0x1p-124f)),
                                distance); // 0/0 at the centre, which is inside
    if (v_any(b->far)) {
        vfloat square = vec_dot(p, p), r = v_sqrt(square);
        distance = v_select(b->far, r * v_log(r) * v_splat(1.0f / 3.0f), distance);
    }
    return distance;
}
