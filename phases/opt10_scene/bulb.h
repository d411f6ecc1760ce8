// The Mandelbulb's distance estimate for several packets at once: a packet's own operations wait for each other, the
// others' fill the gaps. Same map as sdf.h's sdf_mandelbulb, as three squarings each of two unit phasors:
// (ρ + iy)⁸ and (x + iz)⁸/ρ⁸, ρ² = x² + z². What only scales the estimate (the derivative's root and quotient) has 14 bits:
// the surface stays where it is, and a step's length errs by 2⁻¹³ of itself.
//
// Beyond |p| = 2^(1/7) every point escapes, and the estimate is positive. For all points beyond 1.15 it is more
// than 0.52 of the distance to that sphere, whatever the number of iterations (proof: tests/py/test_bulb_bound.py; the
// worst is 0.529 near 1.65): what the cone tests of umbra.c use in place of a distance.
#ifndef OPT10_BULB_H
#define OPT10_BULB_H

#include "sdf.h"

#define BULB_SHARE 0.52f

struct bulb {
    real x, y, z, m, dz;
    mask on, far; // on: have not escaped
};

static inline struct bulb bulb_begin(struct vec p, mask done) {
    ACTIVE(LANES - count_of(done));
    COUNT(bulb_begin, call);
    real square = mul_add(p.x, p.x, mul_add(p.y, p.y, mul_add(p.z, p.z, set(1e-30f))));
    struct bulb b = {p.x, p.y, p.z, square, set(1.5f), no_lane(), greater(square, set(1024.0f))};
    b.on = not_in(either(done, b.far));
    return b;
}

// A point with a double in each lane.
struct half_vec {
    half x, y, z;
};

// The first iteration to 40 bits. What float errs by there and in the point itself is what decides where a march in
// float ends: later iterations' errors count an eighth and less of the one before.
static inline struct half_vec bulb_first(half x, half y, half z) {
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
    return (struct half_vec){half_mul_add(k_sin4, cos4, x),
                             half_mul_add(k1, k1, half_neg_mul_add(q, q, y)),
                             half_mul_add(k_sin4, sin4, half_neg_mul_add(k, two, z))};
}

// What comes of an iteration for those that have not escaped before.
static inline void bulb_grow(struct bulb *b, real bailout) {
    COUNT(bulb_grow, call);
    real m = b->m, square = m * m, r = root_guess(m), h = m * r;
    real more = mul_add(neg_mul_add(h, r, set(1.0f)), set(4.0f), set(8.0f)); // 8·√m/h
    b->dz = mul_add_where(b->on, b->dz, square * h * m * more, set(1.0f));
    real grown = mul_add(b->x, b->x, mul_add(b->y, b->y, b->z * b->z));
    b->m = choose(b->on, grown, m);
    b->on = and_not_greater(b->on, grown, bailout);
}

static inline void bulb_step(struct bulb *b, struct vec p, real bailout) {
    ACTIVE(count_of(b->on));
    COUNT(bulb_step, call);
    real x = b->x, y = b->y, z = b->z;
    real k3 = mul_add(x, x, mul_add(z, z, set(1e-30f))), k4 = neg_mul_add(y, y, k3);
    real twice_rho, four_per;
    root_and_inverse(k3, &twice_rho, &four_per);
    real b2 = twice_rho * y, k1 = mul_sub(k4, k4, b2 * b2), q = (k4 + k4) * b2, k = k1 * q;
    real z4 = z * four_per, sin2 = x * z4,
         cos2 = neg_mul_add(z, z4, set(2.0f)); // all of them doubled
    real cos4 = neg_mul_add(sin2, sin2, set(2.0f)), sin4 = sin2 * cos2, k_sin4 = k * sin4;
    b->x = mul_add(k_sin4, cos4, p.x);
    b->z = mul_add(k_sin4, sin4, neg_mul_add(k, set(2.0f), p.z));
    b->y = mul_add(k1, k1, neg_mul_add(q, q, p.y));
    bulb_grow(b, bailout);
}

// ln a to 2e-6: what it errs by at a = 1 is a quarter of that, over dz, of the surface's place.
static inline real rough_log(real a) {
    COUNT(rough_log, call);
    real e, f = mantissa_near_1(a, &e) - set(1.0f);
    real p = mul_add(f, set(-0.10063060373067856f), set(0.202902689576149f));
    p = mul_add(f, p, set(-0.25720563530921936f));
    p = mul_add(f, p, set(0.33385127782821655f));
    p = mul_add(f, p, set(-0.4998246431350708f));
    p = mul_add(f, p, set(0.999990701675415f));
    return mul_add(f, p, e * set(0.69314718056f));
}

static inline real bulb_end(const struct bulb *b, struct vec p) {
    COUNT(bulb_end, call);
    real m = most_of(b->m, set(1e-30f));
    real distance = m * rough_inverse_root(m) * (rough_inverse(b->dz) * set(0.25f)) * rough_log(m);
    if (any(b->far)) {
        COUNT(bulb_end, far);
        real square = vec_dot(p, p), r = root(square);
        distance = choose(b->far, r * log_of(r) * set(1.0f / 3.0f), distance);
    }
    return keep(greater(b->m, set(0.0f)), distance); // 0/0 at the centre, which is inside
}

enum {
    ABREAST = 3,
    POOLS = 2 * ABREAST + 1
}; // packets; of shadow rays: in work, on their way out, the next

// From iteration `first` on; `soon`: all may have escaped after one.
__attribute__((always_inline)) static inline void bulbs_end(const struct placed *s, int first,
                                                            bool soon, struct bulb *b,
                                                            const struct vec *p, real *distance) {
    real bailout = set(s->bailout);
    for (int i = first; i < s->iterations; i++) {
        for (int k = 0; k < ABREAST; k++)
            bulb_step(&b[k], p[k], bailout);
        if (soon || i % 2 == 1) {
            mask on = b[0].on;
            for (int k = 1; k < ABREAST; k++)
                on = either(on, b[k].on);
            if (!any(on))
                break;
        }
    }
    for (int k = 0; k < ABREAST; k++)
        distance[k] = bulb_end(&b[k], p[k]);
}

__attribute__((always_inline)) static inline void
bulbs(const struct placed *s, const struct vec *p, const mask *done, bool soon, real *distance) {
    struct bulb b[ABREAST];
    for (int k = 0; k < ABREAST; k++)
        b[k] = bulb_begin(p[k], done[k]);
    bulbs_end(s, 0, soon, b, p, distance);
}

#endif
