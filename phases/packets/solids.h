// Where rays enter and leave solids, in closed form. A sphere is a quadratic; a box is what three pairs of planes have
// in common (T. L. Kay and J. T. Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986); a capped cone what a quadric has
// in common with one. All are convex: one interval each.
//
// Lanes are rays, and the solid is the same in all (LANE_RAYS), or they are solids and the ray is. A ray is first moved
// along itself to where it is nearest to the solid's centre: what follows is rounded at the size of the solid, not at
// that of the way to it.
#ifndef PACKETS_SOLIDS_H
#define PACKETS_SOLIDS_H

#include "numerics.h"
#include "placed.h"
#include "simd/vec.h"

enum lane_of { LANE_RAYS, LANE_SOLIDS };

// Of solid i on, or of it alone.
static inline vfloat fetch(const float *field, int i, enum lane_of lane) {
    return lane == LANE_SOLIDS ? v_load(field + i) : v_splat(field[i]);
}

static inline struct vec fetch_vec(float *const *field, int i, enum lane_of lane) {
    return (struct vec){fetch(field[0], i, lane), fetch(field[1], i, lane),
                        fetch(field[2], i, lane)};
}

static inline vfloat inverse_root(vfloat a, bool newton) {
    COUNT(inverse_root, call);
    if (newton) {
        COUNT(inverse_root, newton);
        return v_rsqrt_newton(v_max(a, v_splat(1e-30f)));
    }
    COUNT(inverse_root, exact);
    return v_splat(1.0f) / v_sqrt(a);
}

static inline vfloat root_of(vfloat a, bool newton) {
    COUNT(root_of, call);
    if (newton) {
        COUNT(root_of, newton);
        return a * v_rsqrt_newton(v_max(a, v_splat(1e-30f)));
    }
    COUNT(root_of, exact);
    return v_sqrt(a);
}

static inline vfloat inverse_of(vfloat d) { // of a direction's part: 0 becomes 1e-20
    return v_splat(1.0f) / v_copysign(v_max(v_abs(d), v_splat(1e-20f)), d);
}

static inline vmask meet_sphere(vmask active, struct vec o, struct vec d, const struct hot *hot,
                                int i, enum lane_of lane, bool newton, vfloat *in, vfloat *out) {
    COUNT(meet_sphere, call);
    struct vec centre = fetch_vec(hot->field + F_CENTRE, i, lane);
    struct vec m = {centre.x - o.x, centre.y - o.y, centre.z - o.z};
    vfloat along = vec_dot(m, d);
    struct vec q = {v_nmadd(along, d.x, m.x), v_nmadd(along, d.y, m.y), v_nmadd(along, d.z, m.z)};
    vfloat rest = fetch(hot->field[F_SQUARE], i, lane) - vec_dot(q, q);
    vmask met = v_and(active, v_cmp_ge(rest, v_splat(0.0f)));
    *in = *out = along;
    if (!v_any(met))
        return met;
    COUNT(meet_sphere, met);
    vfloat half = root_of(rest, newton);
    *in = along - half;
    *out = along + half;
    return met;
}

// Into the solid's frame, and there to where the ray is nearest to its centre: that is `before` from the origin.
static inline void approach(struct vec o, struct vec d, const struct hot *hot, int i,
                            enum lane_of lane, struct vec *c, struct vec *e, vfloat *before) {
    COUNT(approach, call);
    struct vec centre = fetch_vec(hot->field + F_CENTRE, i, lane);
    struct vec m = {o.x - centre.x, o.y - centre.y, o.z - centre.z};
    struct vec x = fetch_vec(hot->field + F_ROW, i, lane);
    struct vec y = fetch_vec(hot->field + F_ROW + 3, i, lane);
    struct vec z = fetch_vec(hot->field + F_ROW + 6, i, lane);
    *before = v_splat(0.0f) - vec_dot(m, d);
    m = vec_along(m, d, *before);
    *c = (struct vec){vec_dot(x, m), vec_dot(y, m), vec_dot(z, m)};
    *e = (struct vec){vec_dot(x, d), vec_dot(y, d), vec_dot(z, d)};
}

// What is between two planes at distance `half` from the origin, of rays that are at c and go 1/per. Be they so near that
// rounding makes both the same: in is no more than out.
static inline void slab(vfloat c, vfloat per, vfloat half, vfloat *in, vfloat *out) {
    vfloat middle = c * per, width = half * v_abs(per);
    *in = v_max(v_splat(0.0f) - middle - width, *in);
    *out = v_min(width - middle, *out);
}

static inline vmask meet_box(struct vec o, struct vec d, const struct hot *hot, int i,
                             enum lane_of lane, vfloat *in, vfloat *out) {
    COUNT(meet_box, call);
    struct vec c, e, half = fetch_vec(hot->field + F_SIZE, i, lane);
    vfloat before;
    approach(o, d, hot, i, lane, &c, &e, &before);
    *in = v_splat(-INFINITY);
    *out = v_splat(INFINITY);
    slab(c.x, inverse_of(e.x), half.x, in, out);
    slab(c.y, inverse_of(e.y), half.y, in, out);
    slab(c.z, inverse_of(e.z), half.z, in, out);
    vmask met = v_cmp_ge(*out, *in);
    *in = *in + before;
    *out = *out + before;
    return met;
}

#define OBLATE 16.0f // the slope of a cone this much wider than high

// Between the caps the cone is where f = x² + z² − (m + k·y)² = A·t² + 2·B·t + C ≤ 0 along a ray, and convex there. A > 0:
// between the roots. Else up to the first root or from the last one on: one of the two lies on the cone's mirror image
// behind its apex, which no cap is near. A ray through a rim may be on either side of it by rounding, and stays a hit.
static inline vmask meet_cone(struct vec o, struct vec d, const struct hot *hot, int i,
                              enum lane_of lane, bool newton, vfloat *in, vfloat *out) {
    COUNT(meet_cone, call);
    struct vec c, e, size = fetch_vec(hot->field + F_SIZE, i, lane);
    vfloat before, zero = v_splat(0.0f), low = v_splat(-INFINITY), high = v_splat(INFINITY);
    approach(o, d, hot, i, lane, &c, &e, &before);
    vfloat per = inverse_of(e.y), steep = v_abs(size.y);
    vmask oblate = v_cmp_lt(v_splat(OBLATE), steep), beside = v_mask_none();
    if (v_any(oblate)) {
        COUNT(meet_cone, oblate);
        // A·t² and C are slope² times what remains of them: from where the ray is between the caps they are small. No
        // further than all of the cone is. The other lanes keep every bit.
        vfloat bound = v_madd(steep, size.x, size.z + size.x);
        vfloat ahead = (zero - c.y) * per;
        ahead = v_select_or_zero(oblate, v_min(v_max(ahead, zero - bound), bound));
        c = vec_along(c, e, ahead);
        before = before + ahead;
        // Still above it or below it: so far off is what its quadratic may no longer tell.
        beside = v_and(oblate, v_cmp_lt(v_madd(v_splat(1e-6f), bound, size.x), v_abs(c.y)));
    }
    slab(c.y, per, size.x, &low, &high);
    vfloat wide = v_madd(size.y, c.y, size.z), dk = size.y * e.y;
    vfloat a = v_madd(e.x, e.x, v_msub(e.z, e.z, dk * dk));
    a = v_select(v_cmp_eq(a, zero), v_splat(-1e-37f),
                 a); // along the side: the other root is far away
    vfloat b = v_madd(c.x, e.x, v_msub(c.z, e.z, wide * dk));
    vfloat cc = v_madd(c.x, c.x, v_msub(c.z, c.z, wide * wide));
    vfloat square = v_msub(b, b, a * cc);
    vfloat r = root_of(v_max(square, zero), newton);
    // The root whose sum does not cancel, and the other by their product.
    vfloat sum = v_select(v_cmp_lt(b, zero), r - b, zero - b - r), one = cc / sum, other = sum / a;
    vfloat first = v_min(one, other), last = v_max(one, other);
    vmask roots = v_cmp_ge(square, zero), round = v_cmp_gt(a, zero);
    vmask from_cap = v_cmp_ge(zero, v_madd(low, v_madd(low, a, b + b), cc)); // where A < 0
    vmask up_to = v_and(roots, v_cmp_ge(first, low));
    vfloat end = v_select(v_or(round, v_and(from_cap, up_to)), v_select(round, last, first), high);
    vfloat begin = v_select(round, first, v_select(from_cap, low, last));
    *in = v_max(begin, low);
    *out = v_min(end, high);
    vmask met = v_and(v_cmp_ge(*out, *in), v_or(roots, v_andnot(round, from_cap)));
    met = v_andnot(beside, met);
    *in = *in + before;
    *out = *out + before;
    return met;
}

// How deep the rays' origins are within a solid that they are in: minus the distance to its surface.
static inline vfloat depth_in(enum solid type, struct vec o, const struct hot *hot, int i,
                              enum lane_of lane) {
    COUNT(depth_in, call);
    struct vec centre = fetch_vec(hot->field + F_CENTRE, i, lane);
    struct vec m = {o.x - centre.x, o.y - centre.y, o.z - centre.z};
    if (type == SOLID_SPHERE) {
        COUNT(depth_in, sphere);
        return vec_norm(m) - v_sqrt(fetch(hot->field[F_SQUARE], i, lane));
    }
    COUNT(depth_in, turned);
    struct vec p = {vec_dot(fetch_vec(hot->field + F_ROW, i, lane), m),
                    vec_dot(fetch_vec(hot->field + F_ROW + 3, i, lane), m),
                    vec_dot(fetch_vec(hot->field + F_ROW + 6, i, lane), m)};
    struct vec size = fetch_vec(hot->field + F_SIZE, i, lane);
    if (type == SOLID_BOX) {
        COUNT(depth_in, box);
        return v_max(v_abs(p.x) - size.x, v_max(v_abs(p.y) - size.y, v_abs(p.z) - size.z));
    }
    COUNT(depth_in, cone);
    vfloat side = v_sqrt(v_madd(p.x, p.x, p.z * p.z)) - v_madd(size.y, p.y, size.z);
    side = side / v_sqrt(v_madd(size.y, size.y, v_splat(1.0f)));
    return v_max(side, v_abs(p.y) - size.x);
}

// Of the lanes that are `active`: what the others hold may be of a tile drawn before, and is not to steer anything.
static inline vmask meet(enum solid type, vmask active, struct vec o, struct vec d,
                         const struct hot *hot, int i, enum lane_of lane, bool newton, vfloat *in,
                         vfloat *out) {
    if (type == SOLID_SPHERE)
        return meet_sphere(active, o, d, hot, i, lane, newton, in, out);
    return v_and(active, type == SOLID_BOX ? meet_box(o, d, hot, i, lane, in, out)
                                           : meet_cone(o, d, hot, i, lane, newton, in, out));
}

#endif
