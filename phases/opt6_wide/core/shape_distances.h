// Signed distances of one shape, from one point in each lane. Sphere, box, torus, capped cone, octahedron: I. Quilez,
// "distance functions" (iquilezles.org/articles/distfunctions). Mandelbulb: D. White and P. Nylander's power-8 map
// without trigonometry, with the running derivative: I. Quilez, "mandelbulb" (iquilezles.org/articles/mandelbulb).
// Mandelbox: T. Lowe (fractalforums.com, 2010), with the running derivative of Buddhi and Rrrola (fractalforums.com,
// 2010). Both are estimates, not bounds.
#pragma once

#include "core/primitive.h"
#include "simd/simd.h"

// Rays in the frame of one shape. With EVAL_LINEAR the distance is origin.x + t·direction.x. With EVAL_POWER |p|² −
// radius² is power + t·(t + slope).
struct local_ray {
    struct vec origin, direction;
    union {
        struct {
            vfloat power, slope;
        };
        struct region
            *region; // EVAL_FIELD: where its rays need a part of the program only (opt7_tiles)
    };
};

// Returns the distance to a group at p, a point of its frame at distance t along the ray or beside it:
// groups/field.c.
vfloat field_at(const struct local_ray *a, vfloat t, struct vec p,
                const struct primitive *primitive, vmask live);

// Returns v in the axes of the shape.
static inline struct vec turned(const struct primitive *primitive, struct vec v) {
    if (!primitive->turned)
        return v;
    return (struct vec){vec_dot(vec_set(primitive->turn[0]), v),
                        vec_dot(vec_set(primitive->turn[1]), v),
                        vec_dot(vec_set(primitive->turn[2]), v)};
}

// Returns v in the world's axes. The matrix is orthogonal, so its inverse is its transpose.
static inline struct vec turned_back(const struct primitive *primitive, struct vec v) {
    if (!primitive->turned)
        return v;
    struct vec out = vec_scale(vec_set(primitive->turn[0]), v.x);
    out = vec_along(out, vec_set(primitive->turn[1]), v.y);
    return vec_along(out, vec_set(primitive->turn[2]), v.z);
}

static inline vfloat wrapped(vfloat x, float cell, float per_cell) { // cell 0: not repeated
    return v_nmadd(v_splat(cell), v_floor(v_madd(x, v_splat(per_cell), v_splat(0.5f))), x);
}

static inline struct vec vec_wrapped(const struct primitive *primitive, struct vec p) {
    return (struct vec){wrapped(p.x, primitive->cell[0], primitive->per_cell[0]),
                        wrapped(p.y, primitive->cell[1], primitive->per_cell[1]),
                        wrapped(p.z, primitive->cell[2], primitive->per_cell[2])};
}

static inline vdouble v_double_wrapped(vdouble x, double cell, double per_cell) {
    vdouble turns = v_double_floor(v_double_sub(v_double_mul(x, per_cell), -0.5));
    return v_double_madd(turns, -cell, x);
}

// Returns one coordinate in the shape's frame, computed in double because it cancels. In float, a point 5 from a
// turned box would have a face's distance to 5e-7, which is the hit distance, and in the 10,000th cell to 4e-3.
static inline vfloat coordinate(const struct primitive *primitive, struct vec_double from,
                                int axis) {
    vdouble x = v_double_sub(v_double_dot(from, primitive->row[axis]), primitive->offset);
    if (primitive->repeated)
        x = v_double_wrapped(x, primitive->wide_cell[axis], primitive->wide_per_cell[axis]);
    return v_double_to_float(x);
}

// Returns |from|² − square.
static inline vfloat power_at(struct vec_double from, double square) {
    struct vec_double p = from;
    vhalf each = v_half_splat(square);
    return v_double_to_float(
        (vdouble){p.x.low * p.x.low + p.y.low * p.y.low + p.z.low * p.z.low - each,
                  p.x.high * p.x.high + p.y.high * p.y.high + p.z.high * p.z.high - each});
}

// Whether points are within the scene's bounds, computed in double.
static inline vmask within(struct point place, const struct model *model) {
    double radius = model->march.bounds_radius;
    return v_cmp_ge(v_splat(0.0f), power_at(vec_double_of(place), radius * radius));
}

static inline vfloat sdf_sphere(struct vec p, const struct primitive *s) {
    return vec_norm(p) - v_splat(s->a);
}

// Returns |p| − a, from power = |p|² − a². For a sphere of a planet's size, the difference of |p| and a would lose all
// digits.
static inline vfloat sdf_power(vfloat power, const struct primitive *s) {
    return power / (v_sqrt(v_max(power + v_splat(s->b), v_splat(0.0f))) + v_splat(s->a));
}

static inline vfloat sdf_plane(struct vec p, const struct primitive *s) {
    return vec_dot(p, vec_set(s->size)) - v_splat(s->a);
}

static inline vfloat sdf_box(struct vec p, const struct primitive *s) {
    vfloat zero = v_splat(0.0f);
    vfloat x = v_abs(p.x) - v_splat(s->size[0]);
    vfloat y = v_abs(p.y) - v_splat(s->size[1]);
    vfloat z = v_abs(p.z) - v_splat(s->size[2]);
    struct vec outside = {v_max(x, zero), v_max(y, zero), v_max(z, zero)};
    return vec_norm(outside) + v_min(v_max(x, v_max(y, z)), zero);
}

static inline vfloat sdf_rounded_box(struct vec p, const struct primitive *s) {
    return sdf_box(p, s) - v_splat(s->a);
}

static inline vfloat sdf_torus(struct vec p, const struct primitive *s) {
    vfloat ring = v_sqrt(v_madd(p.x, p.x, p.z * p.z)) - v_splat(s->a);
    return v_sqrt(v_madd(ring, ring, p.y * p.y)) - v_splat(s->b);
}

static inline vfloat sdf_cone(struct vec p, const struct primitive *s) {
    vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vfloat x = radius - v_splat(s->b), y = p.y - v_splat(s->c); // from the top rim
    vfloat rim = v_select(v_cmp_lt(p.y, zero), v_splat(s->a), v_splat(s->b));
    vfloat cap_x = v_max(radius - rim, zero), cap_y = v_abs(p.y) - v_splat(s->c);
    vfloat across = v_madd(x, v_splat(s->slope[0]), y * v_splat(s->slope[1]));
    vfloat along = v_min(v_max(across * v_splat(-s->per_slope_sq), zero), one);
    vfloat side_x = v_madd(v_splat(s->slope[0]), along, x);
    vfloat side_y = v_madd(v_splat(s->slope[1]), along, y);
    vmask inside = v_and(v_signbit(side_x), v_signbit(cap_y));
    vfloat square =
        v_min(v_madd(cap_x, cap_x, cap_y * cap_y), v_madd(side_x, side_x, side_y * side_y));
    return v_negate_where(inside, v_sqrt(square));
}

static inline vfloat sdf_octahedron(struct vec point, const struct primitive *s) {
    vfloat x = v_abs(point.x), y = v_abs(point.y), z = v_abs(point.z);
    vfloat zero = v_splat(0.0f), radius = v_splat(s->a);
    vfloat m = x + y + z - radius, third = m * v_splat(1.0f / 3.0f);
    vmask over_yz = v_cmp_lt(x, third), over_zx = v_cmp_lt(y, third), over_xy = v_cmp_lt(z, third);
    vfloat face = m * v_splat(0.57735026918962576451f); // 1/√3
    vmask edges = v_or(over_yz, v_or(over_zx, over_xy));
    if (!v_any(edges))
        return face;
    vfloat a = v_select(over_yz, x, v_select(over_zx, y, z));
    vfloat b = v_select(over_yz, y, v_select(over_zx, z, x));
    vfloat c = v_select(over_yz, z, v_select(over_zx, x, y));
    vfloat k = v_min(v_max(v_splat(0.5f) * (c - b + radius), zero), radius);
    vfloat beside = b - radius + k, above = c - k;
    vfloat edge = v_sqrt(v_madd(a, a, v_madd(beside, beside, above * above)));
    return v_select(edges, edge, face);
}

// A point's orbit under the map, in the form of phase opt2. Lanes that have escaped, or whose ray is done, keep their
// values (the paper's Fig. 5).
struct bulb_orbit {
    struct vec p, w;
    vfloat m, dz;
    vmask far, inside;
};

static inline struct bulb_orbit bulb_start(struct vec p, vmask live) {
    // |w|² becomes |p|^16, which overflows from |p| = 256 on. From 32 on the estimate after the one iteration that
    // escapes is r·ln(r)/3 to a float's precision.
    vfloat m = vec_dot(p, p);
    vmask far = v_cmp_gt(m, v_splat(1024.0f));
    return (struct bulb_orbit){p, p, m, v_splat(1.5f), far, v_andnot(far, live)};
}

static inline void bulb_iterate(struct bulb_orbit *b, vfloat bailout) {
    ACTIVE(v_count(b->inside));
    COUNT(bulb_iterate, call);
    vfloat x = b->w.x, y = b->w.y, z = b->w.z, m = b->m;
    vfloat x2 = x * x, y2 = y * y, z2 = z * z;
    vfloat k3 = x2 + z2, k4 = k3 - y2;
    vfloat per_k3 =
        v_select_or_zero(v_cmp_gt(k3, v_splat(1e-36f)), v_splat(1.0f) / k3); // 0 on the axis
    vfloat k1 = v_madd(k3, k3, y2 * v_nmadd(v_splat(6.0f), k3, y2));
    vfloat cos2 = (x2 - z2) * per_k3, sin2 = v_splat(2.0f) * (x * z) * per_k3;
    vfloat cos4 = v_nmadd(sin2 + sin2, sin2, v_splat(1.0f)), sin4 = (sin2 + sin2) * cos2;
    vfloat k2 = v_splat(8.0f) * y * k4 * k1 * v_sqrt(k3), k2_sin4 = k2 * (sin4 + sin4);
    x = v_madd(k2_sin4, cos4, b->p.x);      // p.x + k2·sin8
    z = v_madd(k2_sin4, sin4, b->p.z - k2); // p.z − k2·cos8
    y = v_madd(k1, k1, v_nmadd(v_splat(16.0f) * y2 * k3, k4 * k4, b->p.y));
    vfloat slope = v_madd(v_splat(8.0f) * (m * m * m * v_sqrt(m)), b->dz, v_splat(1.0f));
    vfloat grown = v_madd(x, x, v_madd(y, y, z * z));
    b->w = (struct vec){x, y, z};
    b->m = v_select(b->inside, grown, m);
    b->dz = v_select(b->inside, slope, b->dz);
    b->inside = v_cmp_ngt_in(b->inside, b->m, bailout);
}

static inline vfloat bulb_estimate(const struct bulb_orbit *b) {
    // r·ln(r)/3 is √m·ln(m)/6.
    vfloat per = v_select(b->far, v_splat(1.0f / 6.0f), v_splat(0.25f) / b->dz);
    vfloat distance = v_sqrt(b->m) * per * v_log(b->m);
    return v_select_or_zero(v_cmp_gt(b->m, v_splat(0.0f)), distance); // √m·ln m → 0 at the centre
}

static inline vfloat sdf_mandelbulb(struct vec p, const struct primitive *s, vmask live) {
    struct bulb_orbit bulb = bulb_start(p, live);
    for (int i = 0; i < s->iterations; i++) {
        bulb_iterate(&bulb, v_splat(s->bailout));
        if (!v_any(bulb.inside))
            break;
    }
    return bulb_estimate(&bulb);
}

// Returns a lower bound of estimate + t for all later t, from a point at distance √square from the centre. The
// distance to the centre falls no faster than t grows. Beyond r = 3/2 the first iteration ends at w ≥ r⁸ − r. So the
// estimate, ½·w·ln(w)/(12·r⁷ + 1), is above 0.18 + (r − 3/2)/2, and further iterations hardly lower it.
static inline vfloat bulb_wake_bound(vfloat square, vfloat t) {
    vfloat out = v_sqrt_below(square) - v_splat(1.5f);
    vfloat bound = v_min(out, v_madd(out, v_splat(0.5f), v_splat(0.18f)));
    return v_madd(v_splat(1.0f - 0x1p-10f), bound, t);
}

// x reflected at the nearer of ±limit where it is beyond.
static inline vfloat folded(vfloat x, vfloat limit) {
    return v_msub(v_splat(2.0f), v_min(v_max(x, -limit), limit), x);
}

// The Mandelbox's map folds the point at the planes ±fold_limit, inverts it in the sphere of fixed_radius, scales
// it and adds p. dr is the most by which the iterations stretch a distance.
static inline vfloat sdf_mandelbox(struct vec p, const struct primitive *s) {
    vfloat limit = v_splat(s->c), outer_sq = v_splat(s->size[1]);
    vfloat one = v_splat(1.0f), dr = one;
    struct vec w = p;
    for (int i = 0; i < s->iterations; i++) {
        w = (struct vec){folded(w.x, limit), folded(w.y, limit), folded(w.z, limit)};
        vfloat norm_sq = v_min(v_max(vec_dot(w, w), v_splat(s->size[0])), outer_sq);
        vfloat inversion = outer_sq / norm_sq;
        w = vec_along(p, w, v_splat(s->a) * inversion);
        dr = v_madd(v_splat(s->b) * inversion, dr, one);
    }
    return vec_norm(w) / dr;
}

// Returns the distance at a point of the shape's frame, wrapped if it is repeated. `type` is a constant where this is
// inlined in group_distances().
__attribute__((always_inline)) static inline vfloat
distance_at(struct vec p, const struct primitive *primitive, enum shape_type type, vmask live) {
    switch (type) {
    case SHAPE_SPHERE: return sdf_sphere(p, primitive);
    case SHAPE_BOX: return sdf_box(p, primitive);
    case SHAPE_TORUS: return sdf_torus(p, primitive);
    case SHAPE_CONE: return sdf_cone(p, primitive);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(p, primitive);
    case SHAPE_PLANE: return sdf_plane(p, primitive);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(p, primitive);
    case SHAPE_MANDELBOX: return sdf_mandelbox(p, primitive);
    default: return sdf_mandelbulb(p, primitive, live);
    }
}

// Returns the distance to one shape at distance t along the rays. `kind` and `type` are constants where this is
// inlined.
__attribute__((always_inline)) static inline vfloat
distance_to_shape(const struct local_ray *a, vfloat t, const struct primitive *primitive,
                  bool repeated, enum eval_kind kind, enum shape_type type, vmask live) {
    if (kind == EVAL_POWER)
        return sdf_power(v_madd(t, t + a->slope, a->power), primitive);
    if (kind == EVAL_LINEAR)
        return v_madd(t, a->direction.x, a->origin.x);
    struct vec p = vec_along(a->origin, a->direction, t);
    if (repeated && (type != SHAPE_MANDELBOX || primitive->repeated))
        p = vec_wrapped(primitive, p);
    if (kind == EVAL_FIELD)
        return field_at(a, t, p, primitive, live);
    return distance_at(p, primitive, type, live);
}

// Returns a lower bound of distance + t for all later t. The distance to a steady shape falls no faster than t grows.
// The bound is 2^-18 smaller, of itself and of the shape's size: sixteen times the rounding error, because the point
// in the shape's frame is no further from it than distance + t + size.
static inline vfloat wake_bound(vfloat sum, const struct primitive *primitive) {
    return v_madd(sum, v_splat(1.0f - 0x1p-18f), v_splat(-primitive->slack));
}

// Returns the same bound for a point that may be inside the shape.
static inline vfloat wake_bound_inside(vfloat sum, const struct primitive *primitive) {
    return v_min(wake_bound(sum, primitive),
                 v_madd(sum, v_splat(1.0f + 0x1p-18f), v_splat(-primitive->slack)));
}
