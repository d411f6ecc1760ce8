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

#include "simd/bulb_orbit.h" // needs the others

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

// Returns the estimate ¼·√m/dz·ln m, with √m/√product = m/√(m·product). tiny: keeps differences near the
// centre, where m·product underflows; else the estimate is 0 there.
static inline vfloat bulb_end(const struct scaled_orbit *b, struct vec p, bool tiny) {
    vfloat all = b->product, times = b->m;
    if (tiny)
        times = times * v_rsqrt_newton(b->m);
    else
        all = b->m * all;
    vfloat distance = twice_over_root(times * rough_log(b->m, 0.125f), all, b->slope);
    distance = v_select_or_zero(v_cmp_gt(all, v_splat(0x1p-124f)),
                                distance); // 0/0 at the centre, which is inside the set
    if (v_any(b->far)) {
        vfloat square = vec_dot(p, p), r = v_sqrt(square);
        distance = v_select(b->far, r * v_log(r) * v_splat(1.0f / 3.0f), distance);
    }
    return distance;
}

enum { REFILL = LANES * LANES / 32 }; // number of ended lanes that triggers a refill
