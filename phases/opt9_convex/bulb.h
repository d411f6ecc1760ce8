// The Mandelbulb's distance estimate for several packets at once: a packet's own operations wait for each other, the
// others' fill the gaps. Same map as sdf.h's sdf_mandelbulb; its two roots and its quotient are reciprocal roots.
//
// Beyond |p| = 2^(1/7) every point escapes, and the estimate is positive. For all points beyond 1.15 it is more
// than 0.52 of the distance to that sphere (the least of 40,000 directions at 15 radii, 1 to 10 iterations, is
// 0.53 near 1.8): what the cone tests of umbra.c use in place of a distance.
#ifndef OPT9_BULB_H
#define OPT9_BULB_H

#include "sdf.h"

#define BULB_SHARE 0.52f

struct bulb {
    real x, y, z, m, dz;
    mask escaped, far;
};

static inline struct bulb bulb_begin(struct vec p, mask done) {
    ACTIVE(LANES - count_of(done));
    COUNT(bulb_begin, call);
    struct bulb b = {p.x, p.y, p.z, vec_dot(p, p), set(1.5f), done, no_lane()};
    b.far = greater(b.m, set(1024.0f));
    b.escaped = either(done, b.far);
    return b;
}

static inline void bulb_step(struct bulb *b, struct vec p, real bailout) {
    ACTIVE(LANES - count_of(b->escaped));
    COUNT(bulb_step, call);
    real x = b->x, y = b->y, z = b->z, m = b->m;
    real x2 = x * x, y2 = y * y, z2 = z * z;
    real k3 = most_of(x2 + z2, set(1e-30f)), k4 = k3 - y2, per_root = inverse_root(k3);
    real per_k3 = per_root * per_root;
    real k1 = mul_add(k3, k3, y2 * neg_mul_add(set(6.0f), k3, y2));
    real cos2 = (x2 - z2) * per_k3, sin2 = (x + x) * z * per_k3, twice = sin2 + sin2;
    real cos4 = neg_mul_add(twice, sin2, set(1.0f)), sin4 = twice * cos2;
    real k2 = set(8.0f) * y * k4 * k1 * (k3 * per_root), k2_sin4 = k2 * (sin4 + sin4);
    real m2 = m * m, slope = mul_add(set(8.0f) * (m2 * m2) * inverse_root(most_of(m, set(1e-30f))),
                                     b->dz, set(1.0f));
    real nx = mul_add(k2_sin4, cos4, p.x), nz = mul_add(k2_sin4, sin4, p.z - k2);
    real ny = mul_add(k1, k1, neg_mul_add(set(16.0f) * y2 * k3, k4 * k4, p.y));
    real grown = mul_add(nx, nx, mul_add(ny, ny, nz * nz));
    b->x = nx;
    b->y = ny;
    b->z = nz;
    b->m = choose(b->escaped, m, grown);
    b->dz = choose(b->escaped, b->dz, slope);
    b->escaped = either(b->escaped, greater(b->m, bailout));
}

static inline real bulb_end(const struct bulb *b, struct vec p) {
    COUNT(bulb_end, call);
    real m = most_of(b->m, set(1e-30f));
    real distance = set(0.25f) * (m * inverse_root(m)) / b->dz * log_of(m);
    if (any(b->far)) {
        COUNT(bulb_end, far);
        real square = vec_dot(p, p), r = root(square);
        distance = choose(b->far, r * log_of(r) * set(1.0f / 3.0f), distance);
    }
    return keep(greater(b->m, set(0.0f)), distance);
}

enum { ABREAST = 3 }; // packets

__attribute__((always_inline)) static inline void bulbs(const struct placed *s, const struct vec *p,
                                                        const mask *done, real *distance) {
    real bailout = set(s->bailout);
    struct bulb b[ABREAST];
    for (int k = 0; k < ABREAST; k++)
        b[k] = bulb_begin(p[k], done[k]);
    for (int i = 0; i < s->iterations; i++) {
        mask escaped = all_lanes();
        for (int k = 0; k < ABREAST; k++) {
            bulb_step(&b[k], p[k], bailout);
            escaped = both(escaped, b[k].escaped);
        }
        if (all(escaped))
            break;
    }
    for (int k = 0; k < ABREAST; k++)
        distance[k] = bulb_end(&b[k], p[k]);
}

#endif
