// The Mandelbulb's distance estimate for several packets at once: a packet's own operations wait for each other, the
// others' fill the gaps. Same map as sdf.h's sdf_mandelbulb, as three squarings each of two unit phasors:
// (ρ + iy)⁸ and (x + iz)⁸/ρ⁸, ρ² = x² + z². The derivative's small summand has 14 bits (11 with 8 lanes), and
// scales the estimate alone: the surface stays where it is.
//
// Beyond |p| = 2^(1/7) every point escapes, and the estimate is positive. For all points beyond 1.15 it is more
// than 0.52 of the distance to that sphere, whatever the number of iterations (proof: tests/py/test_bulb_bound.py; the
// worst is 0.529 near 1.65): what the cone tests of umbra.c use in place of a distance.
#ifndef OPT9_BULB_H
#define OPT9_BULB_H

#include "sdf.h"

#define BULB_SHARE 0.52f

// A point's orbit. The derivative is slope·√product, the product of all m before: its recursion, 8·m³·√m·that + 1,
// becomes 8·m³·slope + 1/√product, whose root is that of the small summand alone: 11 bits will do, but in the first two
// of a camera ray's (`exact`).
struct bulb {
    real x, y, z, flat, m; // flat: x² + z², m: |·|²
    real slope, product;
    mask on, far; // on: have not escaped
};

static inline void bulb_square(struct bulb *b, real *m) {
    b->flat = mul_add(b->x, b->x, mul_add(b->z, b->z, set(1e-30f)));
    *m = mul_add(b->y, b->y, b->flat);
}

static inline struct bulb bulb_begin(struct vec p, mask done) {
    ACTIVE(LANES - count_of(done));
    COUNT(bulb_begin, call);
    struct bulb b = {.x = p.x, .y = p.y, .z = p.z};
    bulb_square(&b, &b.m);
    b.far = greater(b.m, set(1024.0f));
    b.on = not_in(either(done, b.far));
    return b;
}

// A point with a double in each lane, and the derivative there.
struct half_bulb {
    half x, y, z, slope;
};

// The first iteration to 40 bits (33 with 8 lanes). What float errs by there and in the point itself is what decides where a march in
// float ends: later iterations' errors count an eighth and less of the one before.
static inline struct half_bulb bulb_first(half x, half y, half z) {
    COUNT(bulb_first, call);
    half one = half_set(1.0), two = half_set(2.0);
    half k3 = half_mul_add(x, x, half_mul_add(z, z, half_set(1e-30)));
    half k4 = half_neg_mul_add(y, y, k3);
    half r = half_rough_inverse_root(k3), h = k3 * r, error = half_neg_mul_add(h, r, one);
    half more = error * half_mul_add(error, half_set(0.375), half_set(0.5));
    half rho = half_mul_add(h, more, h), per = half_mul_add(r, more, r);
    half b2 = (rho + rho) * y, k1 = half_neg_mul_add(b2, b2, k4 * k4);
    half q = (k4 + k4) * b2, k = k1 * q, z4 = z * ((per + per) * (per + per));
    half sin2 = x * z4, cos2 = half_neg_mul_add(z, z4, two);
    half cos4 = half_neg_mul_add(sin2, sin2, two), sin4 = sin2 * cos2, k_sin4 = k * sin4;
    half m = half_mul_add(y, y, k3), s = half_rough_inverse_root(m), root = m * s;
    half twelve = half_mul_add(half_neg_mul_add(root, s, one), half_set(6.0), half_set(12.0));
    return (struct half_bulb){half_mul_add(k_sin4, cos4, x),
                              half_mul_add(k1, k1, half_neg_mul_add(q, q, y)),
                              half_mul_add(k_sin4, sin4, half_neg_mul_add(k, two, z)),
                              half_mul_add((m * m) * m, root * twelve, one)};
}

// What comes of an iteration for those that have not escaped before.
static inline void bulb_grow(struct bulb *b, real bailout) {
    COUNT(bulb_grow, call);
    real grown;
    bulb_square(b, &grown);
    b->m = choose(b->on, grown, b->m);
    b->on = but_greater(b->on, grown, bailout);
}

// 1/√a for the derivative's sum.
static inline real small_root(real a, bool exact) {
    return exact ? rough_inverse_root(a) : root_guess(a);
}

// With A = ρ² − y² the real part of (ρ + iy)⁴ is k1 = 2·A² − m², and k2 = 4·ρ·y·A is the other: k1² − k2² is (ρ + iy)⁸'s, and
// 2·k1·k2, twice k, beside it. (x + iz)²/ρ² and ⁴ are doubled, so that their product needs no factor. Doubled by sums, z
// and m² scaled by their exponents: products are what bounds an iteration on Zen 4, and of those (all but the first
// iteration, 16 lanes) there are 27 where there were 32, in two instructions more. z = ±0 becomes ±2⁻¹²⁵, which adds nothing;
// what becomes of ∞ is in lanes that have escaped.
static inline void bulb_step(struct bulb *b, struct vec p, int i, int first, bool exact,
                             real bailout) {
    ACTIVE(count_of(b->on));
    COUNT(bulb_step, call);
    real x = b->x, y = b->y, z = b->z, m = b->m, square = m * m;
    if (i == 0) {
        COUNT(bulb_step, first);
        b->product = m;
        b->slope = mul_add(square * set(12.0f), m, small_root(m, exact));
    } else {
        COUNT(bulb_step, later);
        if (i ==
            first) // told to be `first` by close.h: what has escaped before is √m too short, which is safe
            b->product = m;
        else {
            COUNT(bulb_step, product);
            b->product = mul_add_where(b->on, b->product, m, set(0.0f));
        }
        b->slope = mul_add_where(b->on, b->slope, scaled(square, set(3.0f)) * m,
                                 small_root(b->product, exact && i <= 1));
    }
    struct rooted rho = rooted(b->flat);
    real a = neg_mul_add(y, y, b->flat), k1 = mul_sub(a + a, a, square);
    real half = a * twice_root_times(&rho, y), k2 = half + half, k = k1 * k2;
    real z1 = divided_by(scaled(z, set(2.0f)), &rho), sin2 = x * z1;
    real cos2 = neg_mul_add(z, z1, set(2.0f)), cos4 = neg_mul_add(sin2, sin2, set(2.0f));
    real sin4 = sin2 * cos2, k_sin4 = k * sin4;
    b->x = mul_add(k_sin4, cos4, p.x);
    b->z = mul_add(k_sin4, sin4, p.z - (k + k));
    b->y = mul_add(k1, k1, neg_mul_add(k2, k2, p.y));
    bulb_grow(b, bailout);
}

// ⅛·ln a to 3e-7: what it errs by at a = 1 is, over the derivative, of the surface's place.
static inline real rough_log(real a) {
    COUNT(rough_log, call);
    real e, f = mantissa_near_1(a, &e) - set(1.0f);
    real p = mul_add(f, set(0.125f * -0.10063060373067856f), set(0.125f * 0.202902689576149f));
    p = mul_add(f, p, set(0.125f * -0.25720563530921936f));
    p = mul_add(f, p, set(0.125f * 0.33385127782821655f));
    p = mul_add(f, p, set(0.125f * -0.4998246431350708f));
    p = mul_add(f, p, set(0.125f * 0.999990701675415f));
    return mul_add(f, p, e * set(0.125f * 0.69314718056f));
}

// ¼·√m/dz·ln m, with √m/√product = m/√(m·product). `tiny`: to tell differences near the centre, too, where the
// product of both is below all floats; else it is 0 there.
static inline real bulb_end(const struct bulb *b, struct vec p, bool tiny) {
    COUNT(bulb_end, call);
    real all = b->product, times = b->m;
    if (tiny) {
        COUNT(bulb_end, tiny);
        times = times * rough_inverse_root(b->m);
    } else {
        all = b->m * all;
    }
    real distance = twice_over_root(times * rough_log(b->m), all, b->slope);
    distance = keep(greater(all, set(0x1p-124f)), distance); // 0/0 at the centre, which is inside
    if (any(b->far)) {
        COUNT(bulb_end, far);
        real square = vec_dot(p, p), r = root(square);
        distance = choose(b->far, r * log_of(r) * set(1.0f / 3.0f), distance);
    }
    return distance;
}

enum {
    ABREAST = 3,
    POOLS = 2 * ABREAST + 1
}; // packets; of shadow rays: in work, on their way out, the next
enum { REFILL = LANES * LANES / 32 }; // so many lanes that have ended are filled again

// From iteration `first` on, of `count` packets; `soon`: all may have escaped after one.
__attribute__((always_inline)) static inline void bulbs_end(const struct placed *s, int first,
                                                            bool soon, bool exact, bool tiny,
                                                            int count, struct bulb *b,
                                                            const struct vec *p, real *distance) {
    real bailout = set(s->bailout);
    for (int i = first; i < s->iterations; i++) {
        for (int k = 0; k < count; k++)
            bulb_step(&b[k], p[k], i, first, exact, bailout);
        if (soon || i % 2 == 1) {
            mask on = b[0].on;
            for (int k = 1; k < count; k++)
                on = either(on, b[k].on);
            if (!any(on))
                break;
        }
    }
    for (int k = 0; k < count; k++)
        distance[k] = bulb_end(&b[k], p[k], tiny);
}

__attribute__((always_inline)) static inline void bulbs(const struct placed *s, const struct vec *p,
                                                        const mask *done, bool soon, bool exact,
                                                        real *distance) {
    struct bulb b[ABREAST];
    for (int k = 0; k < ABREAST; k++)
        b[k] = bulb_begin(p[k], done[k]);
    bulbs_end(s, 0, soon, exact, false, ABREAST, b, p, distance);
}

#endif
