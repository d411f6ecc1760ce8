// Signed distances of one shape, from one point in each lane. Sphere, box, torus, capped cone, octahedron: I. Quilez,
// "distance functions" (iquilezles.org/articles/distfunctions). Mandelbox: T. Lowe (fractalforums.com, 2010), with the
// running derivative of Buddhi and Rrrola (fractalforums.com, 2010): an estimate, not a bound. simd/simd.h
// comes before it.
#pragma once

#include "core/prepared.h"

#include "core/mandelbulb.h" // needs the other

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
// groups/packets.c.
vfloat field_at(const struct local_ray *a, vfloat t, struct vec p,
                const struct primitive *primitive, vmask live);

// Returns v in the axes of the shape.
__attribute__((always_inline)) static inline struct vec turned(const struct primitive *primitive,
                                                               struct vec v) {
    if (!primitive->turned)
        return v;
    return (struct vec){vec_dot(vec_set(primitive->turn[0]), v),
                        vec_dot(vec_set(primitive->turn[1]), v),
                        vec_dot(vec_set(primitive->turn[2]), v)};
}

// Returns v in the world's axes. The matrix is orthogonal, so its inverse is its transpose.
__attribute__((always_inline)) static inline struct vec
turned_back(const struct primitive *primitive, struct vec v) {
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

// x reflected at the nearer of ±limit where it is beyond.
static inline vfloat folded(vfloat x, vfloat limit) {
    return v_msub(v_splat(2.0f), v_min(v_max(x, -limit), limit), x);
}

enum { TURNS = 4 }; // a Mandelbox's points that are iterated side by side

// The Mandelbox's map folds the point at the planes ±fold_limit, inverts it in the sphere of fixed_radius, scales
// it and adds p. dr is the most by which the iterations stretch a distance.
struct orbit {
    struct vec w;
    vfloat dr;
};

static inline void map_mandelbox(struct vec p, const struct primitive *s, struct orbit *at) {
    vfloat limit = v_splat(s->c), outer_sq = v_splat(s->size[1]);
    struct vec w = {folded(at->w.x, limit), folded(at->w.y, limit), folded(at->w.z, limit)};
    vfloat norm_sq = v_min(v_max(vec_dot(w, w), v_splat(s->size[0])), outer_sq);
    vfloat inversion = outer_sq / norm_sq;
    at->w = vec_along(p, w, v_splat(s->a) * inversion);
    at->dr = v_madd(v_splat(s->b) * inversion, at->dr, v_splat(1.0f));
}

// Sets `to` to a Mandelbox's distances at n points in turns: while one waits for a result, the others compute.
__attribute__((always_inline)) static inline void
distances_in_turns(const struct vec *p, int n, const struct primitive *s, vfloat *to) {
    struct orbit at[TURNS];
    for (int k = 0; k < n; k++)
        at[k] = (struct orbit){p[k], v_splat(1.0f)};
    for (int i = 0; i < s->iterations; i++)
        for (int k = 0; k < n; k++)
            map_mandelbox(p[k], s, &at[k]);
    for (int k = 0; k < n; k++)
        to[k] = vec_norm(at[k].w) / at[k].dr;
}

// The same of any number of points. A constant number of turns keeps the orbits in registers.
static inline void sdf_mandelboxes(const struct vec *p, int n, const struct primitive *s,
                                   vfloat *to) {
    for (; n >= TURNS; n -= TURNS, p += TURNS, to += TURNS)
        distances_in_turns(p, TURNS, s, to);
    if (n >= 2) {
        distances_in_turns(p, 2, s, to);
        n -= 2, p += 2, to += 2;
    }
    if (n)
        distances_in_turns(p, 1, s, to);
}

static inline vfloat sdf_mandelbox(struct vec p, const struct primitive *s) {
    vfloat distance;
    distances_in_turns(&p, 1, s, &distance);
    return distance;
}

// Returns the distance at a point of the shape's frame, wrapped if it is repeated. `type` is a constant where this is
// inlined in group_distances().
__attribute__((always_inline)) static inline vfloat
distance_of_type(struct vec p, const struct primitive *primitive, enum shape_type type,
                 vmask live) {
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

// Returns the points at distance t along the rays, in the shape's frame, wrapped if it is repeated.
static inline struct vec point_on(const struct local_ray *a, vfloat t, const struct primitive *s) {
    struct vec p = vec_along(a->origin, a->direction, t);
    return s->repeated ? vec_wrapped(s, p) : p;
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
    if (repeated)
        p = vec_wrapped(primitive, p);
    if (kind == EVAL_FIELD)
        return field_at(a, t, p, primitive, live);
    return distance_of_type(p, primitive, type, live);
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
