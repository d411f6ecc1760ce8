// The Mandelbulb's distance estimate for several packets in turns, so that one packet's operations fill the
// latencies of another's. The map is that of sdf_mandelbulb() in types/sdf.h, as three squarings of two unit
// phasors: (ρ + iy)⁸ and (x + iz)⁸/ρ⁸, ρ² = x² + z². The derivative's small summand has 14 bits (8 lanes:
// 11); it only scales the estimate, so the surface stays in place.
//
// Beyond |p| = 2^(1/7) every point escapes, and the estimate is positive. Beyond 1.15 it exceeds BULB_SHARE
// of the distance to that sphere, for any number of iterations (PROOFS.md, 12.; the least is 0.529, near
// 1.65).
#pragma once

#include "simd/simd.h"
#include "types/known_scene.h"
#include "types/numerics.h"
#include "types/tile_context.h"

// A point's orbit. The derivative is slope·√product, with the product of all earlier m. Its recursion dz' =
// 8·m³·√m·dz + 1 becomes slope' = 8·m³·slope + 1/√product. That root only affects the small summand: 11 bits
// suffice, except in the first two iterations of camera rays.
struct scaled_orbit {
    vfloat x, y, z, flat, m; // flat: x² + z², m: |·|²
    vfloat slope, product;
    vmask on, far; // on: not escaped; far: the estimate is r·ln(r)/3
};

static inline void bulb_square(struct scaled_orbit *b, vfloat *m) {
    b->flat = v_madd(b->x, b->x, v_madd(b->z, b->z, v_splat(1e-30f)));
    *m = v_madd(b->y, b->y, b->flat);
}

// Returns the orbits of points before the first iteration. Lanes of `done` are not iterated.
static inline struct scaled_orbit bulb_begin(struct vec p, vmask done) {
    struct scaled_orbit b = {.x = p.x, .y = p.y, .z = p.z};
    bulb_square(&b, &b.m);
    b.far = v_cmp_gt(b.m, v_splat(1024.0f));
    b.on = v_not(v_or(done, b.far));
    return b;
}

// An orbit after the first iteration, with doubles in half of the lanes.
struct orbit_double {
    vhalf x, y, z, slope;
};

// Returns the first iteration to 40 bits (8 lanes: 33). The rounding of the point and of this iteration
// decides where a march in float ends; each later iteration counts an eighth or less of the one before.
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

// Ends an iteration: keeps m of escaped lanes, and finds which lanes escape.
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

// One iteration of an orbit. With A = ρ² − y², (ρ + iy)⁴ has the real part k1 = 2·A² − m² and the imaginary
// part k2 = 4·ρ·y·A. (ρ + iy)⁸ has k1² − k2² and 2·k1·k2. (x + iz)²/ρ² and its square are kept doubled, so
// that products need no factor. Sums and exponents replace products, which bound an iteration on Zen 4. z =
// ±0 becomes ±2⁻¹²⁵, which adds nothing; infinities occur only in escaped lanes.
static inline void bulb_step(struct scaled_orbit *b, struct vec p, int i, int first, bool exact,
                             vfloat bailout) {
    ACTIVE(v_count(b->on));
    COUNT(bulb_step, call);
    vfloat x = b->x, y = b->y, z = b->z, m = b->m, square = m * m;
    if (i == 0) {
        b->product = m;
        b->slope = v_madd(square * v_splat(12.0f), m, derivative_root(m, exact));
    } else {
        if (i ==
            first) // from bulb/bulb_chebyshev.c: lanes that escaped before are √m too short, which is safe
            b->product = m;
        else
            b->product = v_madd_where(b->on, b->product, m, v_splat(0.0f));
        b->slope = v_madd_where(b->on, b->slope, v_ldexp(square, v_splat(3.0f)) * m,
                                derivative_root(b->product, exact && i <= 1));
    }
    struct rooted rho = rooted(b->flat);
    vfloat a = v_nmadd(y, y, b->flat), k1 = v_msub(a + a, a, square);
    vfloat half = a * twice_root_times(&rho, y), k2 = half + half, k = k1 * k2;
    vfloat z1 = divided_by(v_ldexp(z, v_splat(2.0f)), &rho), sin2 = x * z1;
    vfloat cos2 = v_nmadd(z, z1, v_splat(2.0f)), cos4 = v_nmadd(sin2, sin2, v_splat(2.0f));
    vfloat sin4 = sin2 * cos2, k_sin4 = k * sin4;
    b->x = v_madd(k_sin4, cos4, p.x);
    b->z = v_madd(k_sin4, sin4, p.z - (k + k));
    b->y = v_madd(k1, k1, v_nmadd(k2, k2, p.y));
    bulb_grow(b, bailout);
}

// Returns ⅛·ln a to 3e-7. Its error at a = 1, over the derivative, shifts the surface.
static inline vfloat rough_log(vfloat a) {
    vfloat e, f = v_mantissa_near_1(a, &e) - v_splat(1.0f);
    vfloat p =
        v_madd(f, v_splat(0.125f * -0.10063060373067856f), v_splat(0.125f * 0.202902689576149f));
    p = v_madd(f, p, v_splat(0.125f * -0.25720563530921936f));
    p = v_madd(f, p, v_splat(0.125f * 0.33385127782821655f));
    p = v_madd(f, p, v_splat(0.125f * -0.4998246431350708f));
    p = v_madd(f, p, v_splat(0.125f * 0.999990701675415f));
    return v_madd(f, p, e * v_splat(0.125f * 0.69314718056f));
}

// Returns the estimate ¼·√m/dz·ln m, with √m/√product = m/√(m·product). tiny: keeps differences near the
// centre, where m·product underflows; else the estimate is 0 there.
static inline vfloat bulb_end(const struct scaled_orbit *b, struct vec p, bool tiny) {
    vfloat all = b->product, times = b->m;
    if (tiny)
        times = times * v_rsqrt_newton(b->m);
    else
        all = b->m * all;
    vfloat distance = twice_over_root(times * rough_log(b->m), all, b->slope);
    distance = v_select_or_zero(v_cmp_gt(all, v_splat(0x1p-124f)),
                                distance); // 0/0 at the centre, which is inside the set
    if (v_any(b->far)) {
        vfloat square = vec_dot(p, p), r = v_sqrt(square);
        distance = v_select(b->far, r * v_log(r) * v_splat(1.0f / 3.0f), distance);
    }
    return distance;
}

enum { REFILL = LANES * LANES / 32 }; // number of ended lanes that triggers a refill

// Iterates `count` packets from iteration `first` on, and sets their estimates. soon: tests after every
// iteration whether all have escaped.
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
        b[k] = bulb_begin(p[k], done[k]);
    bulbs_end(s, 0, soon, exact, false, INTERLEAVED, b, p, distance);
}
