// Where rays enter and leave solids, in closed form: a sphere by a quadratic, a box by its three
// slabs (T. L. Kay and J. T. Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986), a capped cone by
// a quadric and a slab. All are convex, so a ray has one interval in each.
//
// The lanes are rays and the solid is the same in all (LANE_RAYS), or the lanes are solids and the
// ray is the same. The origin is first moved along the ray to the point nearest to the solid's
// centre: rounding then has the solid's size, not the distance's.
#pragma once

#include "simd/simd.h"
#include "tree.h"

enum lane_kind { LANE_RAYS, LANE_SOLIDS };

// Loads the field of the solids from i on, or of solid i alone.
static inline vfloat load_field(const float *field, int i, enum lane_kind lane) {
    return lane == LANE_SOLIDS ? v_load(field + i) : v_splat(field[i]);
}

static inline struct vec load_field_vec(float *const *field, int i, enum lane_kind lane) {
    return (struct vec){load_field(field[0], i, lane), load_field(field[1], i, lane),
                        load_field(field[2], i, lane)};
}

// Returns 1/√a, exactly or by one Newton step from the CPU's estimate.
static inline vfloat inverse_sqrt(vfloat a, bool newton) {
    if (newton)
        return v_rsqrt_newton(v_max(a, v_splat(1e-30f)));
    return v_splat(1.0f) / v_sqrt(a);
}

static inline vfloat square_root(vfloat a, bool newton) {
    if (newton)
        return a * v_rsqrt_newton(v_max(a, v_splat(1e-30f)));
    return v_sqrt(a);
}

// Returns 1/d of a direction's component; 0 becomes 1e-20.
static inline vfloat reciprocal(vfloat d) {
    return v_splat(1.0f) / v_copysign(v_max(v_abs(d), v_splat(1e-20f)), d);
}

static inline vmask sphere_interval(vmask active, struct vec o, struct vec d,
                                    const struct solid_arrays *arrays, int i, enum lane_kind lane,
                                    bool newton, vfloat *in, vfloat *out) {
    struct vec centre = load_field_vec(arrays->field + F_CENTRE, i, lane);
    struct vec m = {centre.x - o.x, centre.y - o.y, centre.z - o.z};
    vfloat along = vec_dot(m, d);
    struct vec q = {v_nmadd(along, d.x, m.x), v_nmadd(along, d.y, m.y), v_nmadd(along, d.z, m.z)};
    vfloat rest = load_field(arrays->field[F_SQUARE], i, lane) - vec_dot(q, q);
    vmask met = v_and(active, v_cmp_ge(rest, v_splat(0.0f)));
    *in = *out = along;
    if (!v_any(met))
        return met;
    vfloat half = square_root(rest, newton);
    *in = along - half;
    *out = along + half;
    return met;
}

// Sets the ray in the solid's frame: c is its point nearest to the centre, at distance `before`
// from its origin, and e its direction.
static inline void to_local_ray(struct vec o, struct vec d, const struct solid_arrays *arrays,
                                int i, enum lane_kind lane, struct vec *c, struct vec *e,
                                vfloat *before) {
    struct vec centre = load_field_vec(arrays->field + F_CENTRE, i, lane);
    struct vec m = {o.x - centre.x, o.y - centre.y, o.z - centre.z};
    struct vec x = load_field_vec(arrays->field + F_ROW, i, lane);
    struct vec y = load_field_vec(arrays->field + F_ROW + 3, i, lane);
    struct vec z = load_field_vec(arrays->field + F_ROW + 6, i, lane);
    *before = v_splat(0.0f) - vec_dot(m, d);
    m = vec_along(m, d, *before);
    *c = (struct vec){vec_dot(x, m), vec_dot(y, m), vec_dot(z, m)};
    *e = (struct vec){vec_dot(x, d), vec_dot(y, d), vec_dot(z, d)};
}

// Cuts the interval to the slab between two planes at distance `half` from the origin. The ray is
// at c, and `per` is 1/direction. Rounding keeps in ≤ out, however near the planes are.
static inline void slab(vfloat c, vfloat per, vfloat half, vfloat *in, vfloat *out) {
    vfloat middle = c * per, width = half * v_abs(per);
    *in = v_max(v_splat(0.0f) - middle - width, *in);
    *out = v_min(width - middle, *out);
}

static inline vmask box_interval(struct vec o, struct vec d, const struct solid_arrays *arrays,
                                 int i, enum lane_kind lane, vfloat *in, vfloat *out) {
    struct vec c, e, half = load_field_vec(arrays->field + F_SIZE, i, lane);
    vfloat before;
    to_local_ray(o, d, arrays, i, lane, &c, &e, &before);
    *in = v_splat(-INFINITY);
    *out = v_splat(INFINITY);
    slab(c.x, reciprocal(e.x), half.x, in, out);
    slab(c.y, reciprocal(e.y), half.y, in, out);
    slab(c.z, reciprocal(e.z), half.z, in, out);
    vmask met = v_cmp_ge(*out, *in);
    *in = *in + before;
    *out = *out + before;
    return met;
}

#define OBLATE 16.0f // slope of the side from which a cone is treated as flat

// Between its caps the cone is where f = x² + z² − (m + k·y)² = A·t² + 2·B·t + C ≤ 0 along a ray.
// If A > 0, that is between the roots. Else it is before the first root or behind the last one: the
// other part lies on the cone's mirror image behind its apex, outside of the caps. A ray through a
// rim stays a hit under rounding.
static inline vmask cone_interval(struct vec o, struct vec d, const struct solid_arrays *arrays,
                                  int i, enum lane_kind lane, bool newton, vfloat *in,
                                  vfloat *out) {
    struct vec c, e, size = load_field_vec(arrays->field + F_SIZE, i, lane);
    vfloat before, zero = v_splat(0.0f), low = v_splat(-INFINITY), high = v_splat(INFINITY);
    to_local_ray(o, d, arrays, i, lane, &c, &e, &before);
    vfloat per = reciprocal(e.y), max_along = v_abs(size.y);
    vmask oblate = v_cmp_lt(v_splat(OBLATE), max_along), beside = v_mask_none();
    if (v_any(oblate)) {
        // A·t² and C cancel to 1/slope² of their size. They are small for a ray that starts between
        // the caps, so c moves there, at most as far as the cone reaches. The other lanes keep
        // every bit.
        vfloat bound = v_madd(max_along, size.x, size.z + size.x);
        vfloat ahead = (zero - c.y) * per;
        ahead = v_select_or_zero(oblate, v_min(v_max(ahead, zero - bound), bound));
        c = vec_along(c, e, ahead);
        before = before + ahead;
        // A ray that is still above or below the caps there misses; its quadratic is too inexact.
        beside = v_and(oblate, v_cmp_lt(v_madd(v_splat(1e-6f), bound, size.x), v_abs(c.y)));
    }
    slab(c.y, per, size.x, &low, &high);
    vfloat wide = v_madd(size.y, c.y, size.z), dk = size.y * e.y;
    vfloat a = v_madd(e.x, e.x, v_msub(e.z, e.z, dk * dk));
    // Parallel to the side: one root is far away.
    a = v_select(v_cmp_eq(a, zero), v_splat(-1e-37f), a);
    vfloat b = v_madd(c.x, e.x, v_msub(c.z, e.z, wide * dk));
    vfloat cc = v_madd(c.x, c.x, v_msub(c.z, c.z, wide * wide));
    vfloat square = v_msub(b, b, a * cc);
    vfloat r = square_root(v_max(square, zero), newton);
    // One root by the sum that does not cancel, the other by the product of both.
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

// Returns minus the depth of the rays' origins in a solid that contains them.
static inline vfloat depth_inside(enum solid type, struct vec o, const struct solid_arrays *arrays,
                                  int i, enum lane_kind lane) {
    struct vec centre = load_field_vec(arrays->field + F_CENTRE, i, lane);
    struct vec m = {o.x - centre.x, o.y - centre.y, o.z - centre.z};
    if (type == SOLID_SPHERE)
        return vec_norm(m) - v_sqrt(load_field(arrays->field[F_SQUARE], i, lane));
    struct vec p = {vec_dot(load_field_vec(arrays->field + F_ROW, i, lane), m),
                    vec_dot(load_field_vec(arrays->field + F_ROW + 3, i, lane), m),
                    vec_dot(load_field_vec(arrays->field + F_ROW + 6, i, lane), m)};
    struct vec size = load_field_vec(arrays->field + F_SIZE, i, lane);
    if (type == SOLID_BOX)
        return v_max(v_abs(p.x) - size.x, v_max(v_abs(p.y) - size.y, v_abs(p.z) - size.z));
    vfloat side = v_sqrt(v_madd(p.x, p.x, p.z * p.z)) - v_madd(size.y, p.y, size.z);
    side = side / v_sqrt(v_madd(size.y, size.y, v_splat(1.0f)));
    return v_max(side, v_abs(p.y) - size.x);
}

// Sets where the rays enter and leave a solid; returns which meet it. Other lanes than the active
// ones may hold rays of an earlier tile, and have no effect.
static inline vmask solid_interval(enum solid type, vmask active, struct vec o, struct vec d,
                                   const struct solid_arrays *arrays, int i, enum lane_kind lane,
                                   bool newton, vfloat *in, vfloat *out) {
    if (type == SOLID_SPHERE)
        return sphere_interval(active, o, d, arrays, i, lane, newton, in, out);
    return v_and(active, type == SOLID_BOX ? box_interval(o, d, arrays, i, lane, in, out)
                                           : cone_interval(o, d, arrays, i, lane, newton, in, out));
}

// Sets the distance at which rays enter a solid, from their intervals: minus the depth where a ray
// starts inside. Returns the rays that meet it at all.
static inline vmask entry_distance(vmask met, vfloat in, vfloat out, struct vec o, enum solid type,
                                   const struct solid_arrays *arrays, int i, enum lane_kind lane,
                                   vfloat *t) {
    vfloat zero = v_splat(0.0f);
    met = v_and(met, v_cmp_gt(out, zero));
    *t = in;
    vmask within = v_andnot(v_cmp_gt(in, zero), met);
    if (v_any(within))
        *t = v_select(within, v_min(depth_inside(type, o, arrays, i, lane), zero), in);
    return met;
}
