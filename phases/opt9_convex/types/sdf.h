// Signed distances of as many points at once as there are lanes. Sphere, box, torus, capped cone, octahedron:
// I. Quilez, "distance functions" (iquilezles.org/articles/distfunctions). Mandelbulb: D. White and P.
// Nylander's power-8 map in its trigonometry-free form with the running derivative, I. Quilez, "mandelbulb"
// (iquilezles.org/articles/mandelbulb). Mandelbox: T. Lowe (fractalforums.com, 2010), with the running
// derivative of Buddhi and Rrrola (fractalforums.com, 2010). Both are estimates, not bounds.
//
// In float, a point at |p| = 20 is known to 1e-6, the scene's hit distance. So nothing is evaluated in world
// coordinates. Each ray has an origin and a direction in the frame of each shape, and the march evaluates
// origin + t·direction there, rounded once at the size of the shape. Branches that differ between lanes are
// evaluated for all lanes and selected by mask.
#pragma once

#include "simd/simd.h"

#include "fields/rays.h"
#include "types/known_scene.h"

// Rays in the frame of one shape. EVAL_LINEAR: the distance is origin.x + t·direction.x. EVAL_POWER:
// |p|² − radius² is power + t·(t + slope).
struct local_ray {
    struct vec origin, direction;
    vfloat power, slope;
};

// Returns a·v. A kernel may know that a is (0, 1, 0); products with 0 could change the sign of a zero only.
static inline vfloat add_dot(const float a[3], struct vec v) {
    if (axis_is_up(a))
        return v.y;
    return vec_dot(vec_set(a), v);
}

// Returns v mirrored at the plane through 0 with unit normal a.
INLINE struct vec reflected_at(const float a[3], struct vec v) {
    if (axis_is_up(a))
        return (struct vec){v.x, v_splat(0.0f) - v.y, v.z};
    return vec_reflect(v, vec_set(a));
}

// Returns v turned into the shape's frame.
INLINE struct vec turned(const struct primitive *s, struct vec v) {
    if (!s->turned)
        return v;
    return (struct vec){vec_dot(vec_set(s->turn[0]), v), vec_dot(vec_set(s->turn[1]), v),
                        vec_dot(vec_set(s->turn[2]), v)};
}

// Returns v turned back to world axes, by the transpose.
INLINE struct vec turned_back(const struct primitive *s, struct vec v) {
    if (!s->turned)
        return v;
    struct vec out = vec_scale(vec_set(s->turn[0]), v.x);
    out = vec_along(out, vec_set(s->turn[1]), v.y);
    return vec_along(out, vec_set(s->turn[2]), v.z);
}

// Returns the point p in the shape's frame, in float.
INLINE struct vec to_local(const struct primitive *s, struct vec p) {
    return turned(s, vec_sub(p, vec_set(s->position)));
}

// Returns the height of p over a linear plane.
INLINE vfloat height_over(const struct primitive *s, struct vec p) {
    return add_dot(s->normal, p) - v_splat(s->c);
}

static inline vfloat wrapped(vfloat x, float cell, float per_cell) { // cell 0: not repeated
    return v_nmadd(v_splat(cell), v_floor(v_madd(x, v_splat(per_cell), v_splat(0.5f))), x);
}

static inline struct vec vec_wrapped(const struct primitive *s, struct vec p) {
    return (struct vec){wrapped(p.x, s->cell[0], s->per_cell[0]),
                        wrapped(p.y, s->cell[1], s->per_cell[1]),
                        wrapped(p.z, s->cell[2], s->per_cell[2])};
}

static inline vdouble v_double_wrapped(vdouble x, double cell, double per_cell) {
    vdouble turns = v_double_floor(v_double_sub(v_double_mul(x, per_cell), -0.5));
    return v_double_madd(turns, -cell, x);
}

// Returns one coordinate of a point in the shape's frame, computed in double. In float it would cancel: 5
// units from a turned box it errs by 5e-7, and in the 10,000th cell by 4e-3.
static inline vfloat coordinate(const struct primitive *s, struct vec_double from, int axis) {
    vdouble x = v_double_sub(v_double_dot(from, s->row[axis]), s->offset);
    if (s->repeated)
        x = v_double_wrapped(x, s->wide_cell[axis], s->wide_per_cell[axis]);
    return v_double_to_float(x);
}

// Returns |from|² − square, computed in double.
static inline vfloat power_at(struct vec_double from, double square) {
    struct vec_double p = from;
    vhalf each = v_half_splat(square);
    return v_double_to_float(
        (vdouble){p.x.low * p.x.low + p.y.low * p.y.low + p.z.low * p.z.low - each,
                  p.x.high * p.x.high + p.y.high * p.y.high + p.z.high * p.z.high - each});
}

// Fills one local_rays per shape: where the rays are, and then where they go.
static inline void set_local_origins(struct point origin, const struct prepared *scene,
                                     struct local_ray *local_rays) {
    struct vec_double at = vec_double_of(origin);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *s = &scene->primitives[i];
        if (s->eval == EVAL_POINT && !s->turned && !s->repeated) {
            local_rays[i].origin = point_sub(origin, s->position, scene->extras[i].position_lo);
            continue;
        }
        struct vec_double from = vec_double_sub(at, s->centre);
        local_rays[i].origin.x = coordinate(s, from, 0);
        if (s->eval == EVAL_LINEAR)
            continue;
        local_rays[i].origin.y = coordinate(s, from, 1);
        local_rays[i].origin.z = coordinate(s, from, 2);
        if (s->eval == EVAL_POWER)
            local_rays[i].power = power_at(from, scene->extras[i].radius_sq);
    }
}

static inline void set_local_directions(struct vec direction, const struct prepared *scene,
                                        struct local_ray *local_rays) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *s = &scene->primitives[i];
        if (s->eval == EVAL_LINEAR) {
            local_rays[i].direction.x = vec_dot(vec_set(s->normal), direction);
            continue;
        }
        local_rays[i].direction = turned(s, direction);
        if (s->eval == EVAL_POWER) {
            local_rays[i].slope =
                v_splat(2.0f) * vec_dot(local_rays[i].origin, local_rays[i].direction);
        }
    }
}

// Moves the origins along the rays by a short distance.
static inline void move_local_rays(vfloat by, const struct prepared *scene,
                                   struct local_ray *local_rays) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        struct local_ray *a = &local_rays[i];
        a->origin.x = v_madd(a->direction.x, by, a->origin.x);
        if (scene->primitives[i].eval == EVAL_LINEAR)
            continue;
        a->origin.y = v_madd(a->direction.y, by, a->origin.y);
        a->origin.z = v_madd(a->direction.z, by, a->origin.z);
        if (scene->primitives[i].eval == EVAL_POWER)
            a->power = v_madd(by, by + a->slope, a->power);
    }
}

static inline vfloat sdf_sphere(struct vec p, const struct primitive *s) {
    return vec_norm(p) - v_splat(s->a);
}

// Returns |p| − a from the power |p|² − a². For a large sphere the difference itself would cancel.
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

// The map in the form of phase opt2. Lanes that have escaped, or whose ray is done, keep their values (the
// paper's Fig. 5).
static inline vfloat sdf_mandelbulb(struct vec p, const struct primitive *s, vmask done) {
    vfloat x = p.x, y = p.y, z = p.z, m = vec_dot(p, p), dz = v_splat(1.5f);
    // |p|^16 overflows from |p| = 256 on. From 32 on, the estimate equals r·ln(r)/3 to a float's precision.
    vmask far = v_cmp_gt(m, v_splat(1024.0f)), escaped = v_or(done, far);
    for (int i = 0; i < s->iterations; i++) {
        vfloat x2 = x * x, y2 = y * y, z2 = z * z;
        vfloat k3 = x2 + z2, k4 = k3 - y2;
        vfloat per_k3 =
            v_select_or_zero(v_cmp_gt(k3, v_splat(1e-36f)), v_splat(1.0f) / k3); // 0 on the axis
        vfloat k1 = v_madd(k3, k3, y2 * v_nmadd(v_splat(6.0f), k3, y2));
        vfloat cos2 = (x2 - z2) * per_k3, sin2 = v_splat(2.0f) * (x * z) * per_k3;
        vfloat cos4 = v_nmadd(sin2 + sin2, sin2, v_splat(1.0f)), sin4 = (sin2 + sin2) * cos2;
        vfloat k2 = v_splat(8.0f) * y * k4 * k1 * v_sqrt(k3), k2_sin4 = k2 * (sin4 + sin4);
        x = v_madd(k2_sin4, cos4, p.x);      // p.x + k2·sin8
        z = v_madd(k2_sin4, sin4, p.z - k2); // p.z − k2·cos8
        y = v_madd(k1, k1, v_nmadd(v_splat(16.0f) * y2 * k3, k4 * k4, p.y));
        vfloat slope = v_madd(v_splat(8.0f) * (m * m * m * v_sqrt(m)), dz,
                              v_splat(1.0f)); // its root can wait until now
        vfloat grown = v_madd(x, x, v_madd(y, y, z * z));
        m = v_select(escaped, m, grown);
        dz = v_select(escaped, dz, slope);
        escaped = v_or(escaped, v_cmp_gt(m, v_splat(s->bailout)));
        if (v_all(escaped))
            break;
    }
    vfloat distance =
        v_splat(0.25f) * v_sqrt(m) / dz * v_log(m); // the division beside the logarithm
    if (v_any(far)) {
        vfloat r = v_sqrt(vec_dot(p, p));
        distance = v_select(far, r * v_log(r) * v_splat(1.0f / 3.0f), distance);
    }
    return v_select_or_zero(v_cmp_gt(m, v_splat(0.0f)), distance); // √m·ln m → 0 at the centre
}

// x reflected at the nearer of ±limit where it is beyond.
static inline vfloat folded(vfloat x, vfloat limit) {
    return v_msub(v_splat(2.0f), v_min(v_max(x, -limit), limit), x);
}

// The Mandelbox's map folds the point at the planes ±fold_limit, inverts it in the sphere of
// fixed_radius, scales it and adds p. dr is the most by which the iterations stretch a distance.
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

static inline vfloat sdf_mandelbox(struct vec p, const struct primitive *s) {
    struct orbit at = {p, v_splat(1.0f)};
    for (int i = 0; i < s->iterations; i++)
        map_mandelbox(p, s, &at);
    return vec_norm(at.w) / at.dr;
}

// Returns the distance at a point in the shape's frame, already wrapped if the shape is repeated.
__attribute__((always_inline)) static inline vfloat
distance_at(struct vec p, const struct primitive *s, vmask done) {
    if (IS_GROUP(s))
        return field_distance(s->field, p);
    switch (s->type) {
    case SHAPE_SPHERE: return sdf_sphere(p, s);
    case SHAPE_BOX: return sdf_box(p, s);
    case SHAPE_TORUS: return sdf_torus(p, s);
    case SHAPE_CONE: return sdf_cone(p, s);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(p, s);
    case SHAPE_PLANE: return sdf_plane(p, s);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(p, s);
    case SHAPE_MANDELBOX: return sdf_mandelbox(p, s);
    default: return sdf_mandelbulb(p, s, done);
    }
}

// Returns the points at distance t along the rays, in the shape's frame, wrapped if it is repeated.
static inline struct vec point_on(const struct local_ray *a, vfloat t, const struct primitive *s) {
    struct vec p = vec_along(a->origin, a->direction, t);
    return s->repeated ? vec_wrapped(s, p) : p;
}

// Returns the distance to one shape at distance t along the rays.
__attribute__((always_inline)) static inline vfloat
distance_to_shape(const struct local_ray *a, vfloat t, const struct primitive *s, vmask done) {
    if (s->eval != EVAL_POINT) {
        if (s->eval == EVAL_POWER)
            return sdf_power(v_madd(t, t + a->slope, a->power), s);
        return v_madd(t, a->direction.x, a->origin.x);
    }
    return distance_at(point_on(a, t, s), s, done);
}

// Two packets in turns: while one waits for a result, the other computes.
static inline void distances_to_mandelbox(const struct local_ray *const rays[2], const vfloat t[2],
                                          const struct primitive *s, vfloat to[2]) {
    struct vec p[2] = {point_on(rays[0], t[0], s), point_on(rays[1], t[1], s)};
    struct orbit at[2] = {{p[0], v_splat(1.0f)}, {p[1], v_splat(1.0f)}};
    for (int i = 0; i < s->iterations; i++)
        for (int k = 0; k < 2; k++)
            map_mandelbox(p[k], s, &at[k]);
    for (int k = 0; k < 2; k++)
        to[k] = vec_norm(at[k].w) / at[k].dr;
}

// Returns the distance to the nearest shape and sets its index (the first of equals). Lanes of `done` may hold anything.
static inline vfloat sdf(const struct local_ray *local_rays, vfloat t, const struct prepared *scene,
                         vmask done, vfloat *nearest) {
    vfloat least = v_splat(INFINITY);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *s = &scene->primitives[i];
        vfloat distance = distance_to_shape(&local_rays[i], t, s, done);
        *nearest = v_select(v_cmp_lt(distance, least), v_splat(s->index), *nearest);
        least = v_min(distance, least);
    }
    return least;
}
