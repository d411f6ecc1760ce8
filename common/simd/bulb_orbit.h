// The orbit of a point under the Mandelbulb's power-8 map, as opt8_streams and opt9_convex iterate it. Included by a
// phase's bulb/bulb_estimate.h, whose are struct primitive, INTERLEAVED, bulb_step() and bulb_end().
#pragma once

// A point's orbit. The derivative is slope·√product, with the product of all earlier m. Its recursion,
// 8·m³·√m·derivative + 1, becomes 8·m³·slope + 1/√product. Only the small summand has a root, so 11 bits are enough,
// except in the first two iterations of a camera ray (`exact`).
struct scaled_orbit {
    vfloat x, y, z, flat, m; // flat: x² + z², m: |·|²
    vfloat slope, product;
    vmask on, far; // on: have not escaped; far: the estimate is r·ln(r)/3
};

static inline void bulb_square(struct scaled_orbit *b, vfloat *m) {
    b->flat = v_madd(b->x, b->x, v_madd(b->z, b->z, v_splat(1e-30f)));
    *m = v_madd(b->y, b->y, b->flat);
}

// Writes to `b`. A returned struct would be copied in halves, and loads would wait for the stores.
static inline void bulb_begin(struct scaled_orbit *b, struct vec p, vmask live) {
    ACTIVE(v_count(live));
    COUNT(bulb_estimate, call);
    b->x = p.x;
    b->y = p.y;
    b->z = p.z;
    b->product = b->slope = v_splat(1.0f);
    bulb_square(b, &b->m);
    b->far = v_cmp_gt(b->m, v_splat(1024.0f));
    b->on = v_andnot(b->far, live);
}

// An orbit after the first iteration, with doubles in half of the lanes.
struct orbit_double {
    vhalf x, y, z, slope;
};

// Returns the first iteration, to 40 bits (8 lanes: 33). Its rounding error in float, and the point's, decide where a march in float
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

// Returns share·ln a, to 2.4e-6 of `share`. Its error at a = 1, over the derivative, is that of the surface's place.
static inline vfloat rough_log(vfloat a, float share) {
    vfloat e, f = v_mantissa_near_1(a, &e) - v_splat(1.0f);
    vfloat p =
        v_madd(f, v_splat(share * -0.10063060373067856f), v_splat(share * 0.202902689576149f));
    p = v_madd(f, p, v_splat(share * -0.25720563530921936f));
    p = v_madd(f, p, v_splat(share * 0.33385127782821655f));
    p = v_madd(f, p, v_splat(share * -0.4998246431350708f));
    p = v_madd(f, p, v_splat(share * 0.999990701675415f));
    return v_madd(f, p, e * v_splat(share * 0.69314718056f));
}

static inline void bulb_step(struct scaled_orbit *b, struct vec p, int i, int first, bool exact,
                             vfloat bailout);
static inline vfloat bulb_end(const struct scaled_orbit *b, struct vec p, bool tiny);

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
