// A Mandelbulb's distance estimate. D. White and P. Nylander's power-8 map with the running derivative (I. Quilez,
// "mandelbulb", iquilezles.org/articles/mandelbulb), as three squarings each of two unit phasors: (ρ + iy)⁸ and
// (x + iz)⁸/ρ⁸, ρ² = x² + z²: no division and no exact root. What only scales the estimate (the derivative's root and
// quotient) has 14 bits: the surface stays where it is, and a step's length errs by 2⁻¹³ of itself.
#ifndef OPT8_BULB_H
#define OPT8_BULB_H

#include "sdf.h"

// A point's orbit. The derivative is slope·√product, the product of all m before: its recursion, 8·m³·√m·that + 1,
// becomes 8·m³·slope + 1/√product, whose root is that of the small summand alone: 11 bits will do, but in the first two
// of a camera ray's (`exact`).
struct orbit {
    real x, y, z, flat, m; // flat: x² + z², m: |·|²
    real slope, product;
    mask on, far; // on: have not escaped
};

static inline void bulb_square(struct orbit *b, real *m) {
    b->flat = mul_add(b->x, b->x, mul_add(b->z, b->z, set(1e-30f)));
    *m = mul_add(b->y, b->y, b->flat);
}

// Written where it is to be: returned, it would be copied in halves, and their loads wait for all of the stores.
static inline void bulb_begin(struct orbit *b, struct vec p, mask live) {
    ACTIVE(count_of(live));
    COUNT(bulb_begin, call);
    b->x = p.x;
    b->y = p.y;
    b->z = p.z;
    b->product = b->slope = set(1.0f);
    bulb_square(b, &b->m);
    b->far = greater(b->m, set(1024.0f));
    b->on = but_not(b->far, live);
}

// A point with a double in each lane, and the derivative there.
struct half_orbit {
    half x, y, z, slope;
};

// The first iteration to 40 bits. What float errs by there and in the point itself is what decides where a march in
// float ends: later iterations' errors count an eighth and less of the one before.
static inline struct half_orbit bulb_first(half x, half y, half z) {
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
    return (struct half_orbit){half_mul_add(k_sin4, cos4, x),
                               half_mul_add(k1, k1, half_neg_mul_add(q, q, y)),
                               half_mul_add(k_sin4, sin4, half_neg_mul_add(k, two, z)),
                               half_mul_add((m * m) * m, root * twelve, one)};
}

// What comes of an iteration for those that have not escaped before.
static inline void bulb_grow(struct orbit *b, real bailout) {
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

// With A = ρ² − y²: (ρ + iy)⁴ has 2·A² − m² for its real part, and (ρ + iy)⁸ twice that one's square less m⁴, and
// 8·ρ·y·A·that beside it. (x + iz)²/ρ² and ⁴ are halved and in eighths, K is 128 times what they turn.
static inline void bulb_step(struct orbit *b, struct vec p, int i, int first, bool exact,
                             real bailout) {
    ACTIVE(count_of(b->on));
    COUNT(bulb_step, call);
    real x = b->x, y = b->y, z = b->z, m = b->m, square = m * m, r, per;
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
        b->slope = mul_add_where(b->on, b->slope, square * set(8.0f) * m,
                                 small_root(b->product, exact && i <= 1));
    }
    real a = neg_mul_add(y, y, b->flat), k1 = mul_sub(set(2.0f), a * a, square);
    real k = (a * k1) * (y * root_and_inverse(b->flat, 1024.0f, &r, &per));
    real z1 = (z * r) * per, sin2 = x * z1, cos2 = neg_mul_add(z, z1, set(0.5f));
    real cos4 = neg_mul_add(sin2, sin2, set(0.125f)), sin4 = sin2 * cos2, k_sin4 = k * sin4;
    b->x = mul_add(k_sin4, cos4, p.x);
    b->z = mul_add(k_sin4, sin4, neg_mul_add(k, set(1.0f / 128.0f), p.z));
    b->y = mul_add(set(2.0f), k1 * k1, neg_mul_add(square, square, p.y));
    bulb_grow(b, bailout);
}

// ¼·ln a to 5e-7: what it errs by at a = 1 is, over the derivative, of the surface's place.
static inline real rough_log(real a) {
    COUNT(rough_log, call);
    real e, f = mantissa_near_1(a, &e) - set(1.0f);
    real p = mul_add(f, set(0.25f * -0.10063060373067856f), set(0.25f * 0.202902689576149f));
    p = mul_add(f, p, set(0.25f * -0.25720563530921936f));
    p = mul_add(f, p, set(0.25f * 0.33385127782821655f));
    p = mul_add(f, p, set(0.25f * -0.4998246431350708f));
    p = mul_add(f, p, set(0.25f * 0.999990701675415f));
    return mul_add(f, p, e * set(0.25f * 0.69314718056f));
}

// `tiny`: to tell differences near the centre, too, where the product of both is below all floats; else it is 0 there.
static inline real bulb_end(const struct orbit *b, struct vec p, bool tiny) {
    COUNT(bulb_end, call);
    real all = b->m * b->product, root_of_both; // ¼·√m/dz·ln m, √m/√product = m/√all
    if (tiny) {
        COUNT(bulb_end, tiny);
        root_of_both = rough_inverse_root(b->m) * rough_inverse_root(b->product);
        all = b->product;
    } else {
        root_of_both = rough_inverse_root(all);
    }
    real distance = b->m * root_of_both * rough_inverse(b->slope) * rough_log(b->m);
    distance = keep(greater(all, set(0x1p-124f)), distance); // 0/0 at the centre, which is inside
    if (any(b->far)) {
        COUNT(bulb_end, far);
        real square = vec_dot(p, p), r = root(square);
        distance = choose(b->far, r * log_of(r) * set(1.0f / 3.0f), distance);
    }
    return distance;
}

enum { ABREAST = 3 }; // packets of camera rays

// From iteration `first` on, of `count` packets; `soon`: all may have escaped after one.
__attribute__((always_inline)) static inline void bulbs_end(const struct placed *s, int first,
                                                            bool soon, bool exact, bool tiny,
                                                            int count, struct orbit *b,
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
    struct orbit b[ABREAST];
    for (int k = 0; k < ABREAST; k++)
        bulb_begin(&b[k], p[k], not_in(done[k]));
    bulbs_end(s, 0, soon, exact, false, ABREAST, b, p, distance);
}

#endif
