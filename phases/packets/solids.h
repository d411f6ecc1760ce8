// Where rays enter and leave solids, in closed form. A sphere is a quadratic; a box is what three pairs of planes have
// in common (T. L. Kay and J. T. Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986); a capped cone what a quadric has
// in common with one. All are convex: one interval each.
//
// Lanes are rays, and the solid is the same in all (LANE_RAYS), or they are solids and the ray is. A ray is first moved
// along itself to where it is nearest to the solid's centre: what follows is rounded at the size of the solid, not at
// that of the way to it.
#ifndef PACKETS_SOLIDS_H
#define PACKETS_SOLIDS_H

#include "placed.h"
#include "vec.h"

enum lane_of { LANE_RAYS, LANE_SOLIDS };

// Of solid i on, or of it alone.
static inline real fetch(const float *field, int i, enum lane_of lane) {
    return lane == LANE_SOLIDS ? load(field + i) : set(field[i]);
}

static inline struct vec fetch_vec(float *const *field, int i, enum lane_of lane) {
    return (struct vec){fetch(field[0], i, lane), fetch(field[1], i, lane),
                        fetch(field[2], i, lane)};
}

static inline real inverse_root(real a, bool newton) {
    COUNT(inverse_root, call);
    if (newton) {
        COUNT(inverse_root, newton);
        return newton_inverse_root(most_of(a, set(1e-30f)));
    }
    COUNT(inverse_root, exact);
    return set(1.0f) / root(a);
}

static inline real root_of(real a, bool newton) {
    COUNT(root_of, call);
    if (newton) {
        COUNT(root_of, newton);
        return a * newton_inverse_root(most_of(a, set(1e-30f)));
    }
    COUNT(root_of, exact);
    return root(a);
}

static inline real inverse_of(real d) { // of a direction's part: 0 becomes 1e-20
    return set(1.0f) / with_sign_of(d, most_of(absolute(d), set(1e-20f)));
}

static inline mask meet_sphere(mask active, struct vec o, struct vec d, const struct hot *hot,
                               int i, enum lane_of lane, bool newton, real *in, real *out) {
    COUNT(meet_sphere, call);
    struct vec centre = fetch_vec(hot->field + F_CENTRE, i, lane);
    struct vec m = {centre.x - o.x, centre.y - o.y, centre.z - o.z};
    real along = vec_dot(m, d);
    struct vec q = {neg_mul_add(along, d.x, m.x), neg_mul_add(along, d.y, m.y),
                    neg_mul_add(along, d.z, m.z)};
    real rest = fetch(hot->field[F_SQUARE], i, lane) - vec_dot(q, q);
    mask met = both(active, not_less(rest, set(0.0f)));
    *in = *out = along;
    if (!any(met))
        return met;
    COUNT(meet_sphere, met);
    real half = root_of(rest, newton);
    *in = along - half;
    *out = along + half;
    return met;
}

// Into the solid's frame, and there to where the ray is nearest to its centre: that is `before` from the origin.
static inline void approach(struct vec o, struct vec d, const struct hot *hot, int i,
                            enum lane_of lane, struct vec *c, struct vec *e, real *before) {
    COUNT(approach, call);
    struct vec centre = fetch_vec(hot->field + F_CENTRE, i, lane);
    struct vec m = {o.x - centre.x, o.y - centre.y, o.z - centre.z};
    struct vec x = fetch_vec(hot->field + F_ROW, i, lane);
    struct vec y = fetch_vec(hot->field + F_ROW + 3, i, lane);
    struct vec z = fetch_vec(hot->field + F_ROW + 6, i, lane);
    *before = set(0.0f) - vec_dot(m, d);
    m = vec_along(m, d, *before);
    *c = (struct vec){vec_dot(x, m), vec_dot(y, m), vec_dot(z, m)};
    *e = (struct vec){vec_dot(x, d), vec_dot(y, d), vec_dot(z, d)};
}

// What is between two planes at distance `half` from the origin, of rays that are at c and go 1/per. Be they so near that
// rounding makes both the same: in is no more than out.
static inline void slab(real c, real per, real half, real *in, real *out) {
    real middle = c * per, width = half * absolute(per);
    *in = most_of(set(0.0f) - middle - width, *in);
    *out = least_of(width - middle, *out);
}

static inline mask meet_box(struct vec o, struct vec d, const struct hot *hot, int i,
                            enum lane_of lane, real *in, real *out) {
    COUNT(meet_box, call);
    struct vec c, e, half = fetch_vec(hot->field + F_SIZE, i, lane);
    real before;
    approach(o, d, hot, i, lane, &c, &e, &before);
    *in = set(-INFINITY);
    *out = set(INFINITY);
    slab(c.x, inverse_of(e.x), half.x, in, out);
    slab(c.y, inverse_of(e.y), half.y, in, out);
    slab(c.z, inverse_of(e.z), half.z, in, out);
    mask met = not_less(*out, *in);
    *in = *in + before;
    *out = *out + before;
    return met;
}

#define OBLATE 16.0f // the slope of a cone this much wider than high

// Between the caps the cone is where f = x² + z² − (m + k·y)² = A·t² + 2·B·t + C ≤ 0 along a ray, and convex there. A > 0:
// between the roots. Else up to the first root or from the last one on: one of the two lies on the cone's mirror image
// behind its apex, which no cap is near. A ray through a rim may be on either side of it by rounding, and stays a hit.
static inline mask meet_cone(struct vec o, struct vec d, const struct hot *hot, int i,
                             enum lane_of lane, bool newton, real *in, real *out) {
    COUNT(meet_cone, call);
    struct vec c, e, size = fetch_vec(hot->field + F_SIZE, i, lane);
    real before, zero = set(0.0f), low = set(-INFINITY), high = set(INFINITY);
    approach(o, d, hot, i, lane, &c, &e, &before);
    real per = inverse_of(e.y), steep = absolute(size.y);
    mask oblate = less(set(OBLATE), steep), beside = no_lane();
    if (any(oblate)) {
        COUNT(meet_cone, oblate);
        // A·t² and C are slope² times what remains of them: from where the ray is between the caps they are small. No
        // further than all of the cone is. The other lanes keep every bit.
        real bound = mul_add(steep, size.x, size.z + size.x);
        real ahead = (zero - c.y) * per;
        ahead = keep(oblate, least_of(most_of(ahead, zero - bound), bound));
        c = vec_along(c, e, ahead);
        before = before + ahead;
        // Still above it or below it: so far off is what its quadratic may no longer tell.
        beside = both(oblate, less(mul_add(set(1e-6f), bound, size.x), absolute(c.y)));
    }
    slab(c.y, per, size.x, &low, &high);
    real wide = mul_add(size.y, c.y, size.z), dk = size.y * e.y;
    real a = mul_add(e.x, e.x, mul_sub(e.z, e.z, dk * dk));
    a = choose(equal(a, zero), set(-1e-37f), a); // along the side: the other root is far away
    real b = mul_add(c.x, e.x, mul_sub(c.z, e.z, wide * dk));
    real cc = mul_add(c.x, c.x, mul_sub(c.z, c.z, wide * wide));
    real square = mul_sub(b, b, a * cc);
    real r = root_of(most_of(square, zero), newton);
    // The root whose sum does not cancel, and the other by their product.
    real sum = choose(less(b, zero), r - b, zero - b - r), one = cc / sum, other = sum / a;
    real first = least_of(one, other), last = most_of(one, other);
    mask roots = not_less(square, zero), round = greater(a, zero);
    mask from_cap = not_less(zero, mul_add(low, mul_add(low, a, b + b), cc)); // where A < 0
    mask up_to = both(roots, not_less(first, low));
    real end = choose(either(round, both(from_cap, up_to)), choose(round, last, first), high);
    real begin = choose(round, first, choose(from_cap, low, last));
    *in = most_of(begin, low);
    *out = least_of(end, high);
    mask met = both(not_less(*out, *in), either(roots, but_not(round, from_cap)));
    met = but_not(beside, met);
    *in = *in + before;
    *out = *out + before;
    return met;
}

// How deep the rays' origins are within a solid that they are in: minus the distance to its surface.
static inline real depth_in(enum solid type, struct vec o, const struct hot *hot, int i,
                            enum lane_of lane) {
    COUNT(depth_in, call);
    struct vec centre = fetch_vec(hot->field + F_CENTRE, i, lane);
    struct vec m = {o.x - centre.x, o.y - centre.y, o.z - centre.z};
    if (type == SOLID_SPHERE) {
        COUNT(depth_in, sphere);
        return vec_norm(m) - root(fetch(hot->field[F_SQUARE], i, lane));
    }
    COUNT(depth_in, turned);
    struct vec p = {vec_dot(fetch_vec(hot->field + F_ROW, i, lane), m),
                    vec_dot(fetch_vec(hot->field + F_ROW + 3, i, lane), m),
                    vec_dot(fetch_vec(hot->field + F_ROW + 6, i, lane), m)};
    struct vec size = fetch_vec(hot->field + F_SIZE, i, lane);
    if (type == SOLID_BOX) {
        COUNT(depth_in, box);
        return most_of(absolute(p.x) - size.x,
                       most_of(absolute(p.y) - size.y, absolute(p.z) - size.z));
    }
    COUNT(depth_in, cone);
    real side = root(mul_add(p.x, p.x, p.z * p.z)) - mul_add(size.y, p.y, size.z);
    side = side / root(mul_add(size.y, size.y, set(1.0f)));
    return most_of(side, absolute(p.y) - size.x);
}

// Of the lanes that are `active`: what the others hold may be of a tile drawn before, and is not to steer anything.
static inline mask meet(enum solid type, mask active, struct vec o, struct vec d,
                        const struct hot *hot, int i, enum lane_of lane, bool newton, real *in,
                        real *out) {
    if (type == SOLID_SPHERE)
        return meet_sphere(active, o, d, hot, i, lane, newton, in, out);
    return both(active, type == SOLID_BOX ? meet_box(o, d, hot, i, lane, in, out)
                                          : meet_cone(o, d, hot, i, lane, newton, in, out));
}

#endif
