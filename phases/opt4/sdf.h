// Signed distances of eight points at once. Sphere, box, torus, capped cone, octahedron: I. Quilez,
// "distance functions" (iquilezles.org/articles/distfunctions). Mandelbulb: the power-8 map of
// D. White and P. Nylander without trigonometry, with its running derivative: I. Quilez,
// "mandelbulb" (iquilezles.org/articles/mandelbulb). It is an estimate, not a bound.
//
// The float spacing at |p| = 20 is 1e-6, which is the scene's hit distance. World coordinates are
// therefore too coarse. Each ray keeps its origin and direction in the frame of each shape (struct
// local_ray). The march evaluates origin + t·direction there, with one rounding at the shape's size.
//
// Where lanes take different branches, every branch is evaluated and a mask selects the result.
#pragma once

#include "scene/scene.h"
#include "vec.h"

#include "group.h" // needs vec.h

// How a shape's distance along a ray is evaluated. AT_POINT: at a point of the shape's frame.
// LINEAR: a plane without repetition, whose distance is linear in t. POWER: a sphere wider than the
// bounds, by the power of the point, a polynomial in t.
enum eval_kind { AT_POINT, LINEAR, POWER };

// A shape with only what the march evaluates, prepared once per scene.
struct primitive {
    enum eval_kind eval;
    enum shape_type type;
    bool rotated, repeated;
    float index; // in the scene
    float position[3], position_lo[3];
    float rotation[3][3]; // rows: the three rotations as one matrix
    float cell[3], inv_cell[3];
    float normal[3]; // LINEAR: in world axes
#include "scene/primitive_sizes.h"
    // In double, for a ray's origin: it is moved into the shape's frame and then rounded once.
    // `row` holds the rows of the rotation matrix. LINEAR: row[0] is the normal in world axes.
    double centre[3], row[3][3], offset, radius_sq, cell_double[3], inv_cell_double[3];
};

struct prepared {
    struct model model;
    struct primitive *primitives;     // one per shape
    struct instruction *instructions; // of all groups
};

// Eight rays in the frame of one shape. LINEAR: the distance is origin.x + t·direction.x. POWER:
// |p|² − radius² is power + t·(t + slope).
struct local_ray {
    struct vec origin, direction;
    vfloat power, slope;
};

// A vector of the world in the shape's axes.
static inline struct vec turned(const struct primitive *primitive, struct vec v) {
    COUNT(turned, call);
    if (!primitive->rotated)
        return v;
    COUNT(turned, rotation);
    return (struct vec){vec_dot(vec_set(primitive->rotation[0]), v),
                        vec_dot(vec_set(primitive->rotation[1]), v),
                        vec_dot(vec_set(primitive->rotation[2]), v)};
}

// The inverse of turned(): the matrix is orthogonal, so its inverse is its transpose.
static inline struct vec turned_back(const struct primitive *primitive, struct vec v) {
    COUNT(turned_back, call);
    if (!primitive->rotated)
        return v;
    COUNT(turned_back, rotation);
    struct vec out = vec_scale(vec_set(primitive->rotation[0]), v.x);
    out = vec_along(out, vec_set(primitive->rotation[1]), v.y);
    return vec_along(out, vec_set(primitive->rotation[2]), v.z);
}

// The coordinate within its cell, −cell/2 ... cell/2. Cell 0 means no repetition and returns x.
static inline vfloat wrapped(vfloat x, float cell, float inv_cell) {
    return v_nmadd(v_splat(cell), v_floor(v_madd(x, v_splat(inv_cell), v_splat(0.5f))), x);
}

static inline struct vec vec_wrapped(const struct primitive *primitive, struct vec p) {
    COUNT(vec_wrapped, call);
    return (struct vec){wrapped(p.x, primitive->cell[0], primitive->inv_cell[0]),
                        wrapped(p.y, primitive->cell[1], primitive->inv_cell[1]),
                        wrapped(p.z, primitive->cell[2], primitive->inv_cell[2])};
}

static inline vdouble v_double_wrapped(vdouble x, double cell, double inv_cell) {
    vdouble number = v_double_sub(v_double_mul(x, inv_cell), -0.5);
    number = (vdouble){_mm256_floor_pd(number.low), _mm256_floor_pd(number.high)};
    return v_double_madd(number, -cell, x);
}

// One coordinate of `from` (a point minus the shape's centre) in the shape's frame. In double,
// because the products cancel. In float, a point 5 units from a rotated box would be off by 5e-7,
// near the hit distance; in the 10,000th cell of a repetition the error would be 4e-3.
static inline vfloat coordinate(const struct primitive *primitive, struct vec_double from,
                                int axis) {
    COUNT(coordinate, call);
    vdouble x = v_double_sub(v_double_dot(from, primitive->row[axis]), primitive->offset);
    if (primitive->repeated) {
        COUNT(coordinate, wrap);
        x = v_double_wrapped(x, primitive->cell_double[axis], primitive->inv_cell_double[axis]);
    }
    return v_double_to_float(x);
}

// The power of a point with respect to a sphere: |from|² − radius_sq, in double because it cancels.
static inline vfloat power_at(struct vec_double from, double radius_sq) {
    COUNT(power_at, call);
    return v_double_to_float((vdouble){from.x.low * from.x.low + from.y.low * from.y.low +
                                           from.z.low * from.z.low - radius_sq,
                                       from.x.high * from.x.high + from.y.high * from.y.high +
                                           from.z.high * from.z.high - radius_sq});
}

// Sets the origin of each shape's local ray. `rays` has one element per shape. The directions are
// set apart, because an origin serves several directions.
static inline void local_ray_origins(struct point origin, const struct prepared *scene,
                                     struct local_ray *rays) {
    COUNT(local_ray_origins, call);
    struct vec_double at = vec_double_of(origin);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *primitive = &scene->primitives[i];
        if (primitive->eval == AT_POINT && !primitive->rotated && !primitive->repeated) {
            rays[i].origin = place_sub(origin, primitive->position, primitive->position_lo);
            continue;
        }
        struct vec_double from = vec_double_sub(at, primitive->centre);
        rays[i].origin.x = coordinate(primitive, from, 0);
        if (primitive->eval == LINEAR)
            continue;
        rays[i].origin.y = coordinate(primitive, from, 1);
        rays[i].origin.z = coordinate(primitive, from, 2);
        if (primitive->eval == POWER)
            rays[i].power = power_at(from, primitive->radius_sq);
    }
}

// Sets the direction of each shape's local ray. Precondition: local_ray_origins() has set the origins.
static inline void local_ray_directions(struct vec direction, const struct prepared *scene,
                                        struct local_ray *rays) {
    COUNT(local_ray_directions, call);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *primitive = &scene->primitives[i];
        if (primitive->eval == LINEAR) {
            COUNT(local_ray_directions, linear);
            rays[i].direction.x = vec_dot(vec_set(primitive->normal), direction);
            continue;
        }
        rays[i].direction = turned(primitive, direction);
        if (primitive->eval == POWER) {
            COUNT(local_ray_directions, power);
            rays[i].slope = v_splat(2.0f) * vec_dot(rays[i].origin, rays[i].direction);
        }
    }
}

// Moves the origins by a small distance `by` along the rays, without leaving the shapes' frames.
static inline void local_ray_advance(vfloat by, const struct prepared *scene,
                                     struct local_ray *ray) {
    COUNT(local_ray_advance, call);
    for (int i = 0; i < scene->model.shape_count; i++) {
        struct local_ray *a = &ray[i];
        COUNT(local_ray_advance, first);
        a->origin.x = v_madd(a->direction.x, by, a->origin.x);
        if (scene->primitives[i].eval == LINEAR)
            continue;
        COUNT(local_ray_advance, others);
        a->origin.y = v_madd(a->direction.y, by, a->origin.y);
        a->origin.z = v_madd(a->direction.z, by, a->origin.z);
        if (scene->primitives[i].eval == POWER) {
            COUNT(local_ray_advance, power);
            a->power = v_madd(by, by + a->slope, a->power);
        }
    }
}

static inline vfloat sdf_mandelbox(struct vec p, const struct primitive *s);
#include "packet/distances.h"

// |p| − r as (|p|² − r²)/(|p| + r). For a sphere of a planet's size, |p| − r would cancel to nothing.
static inline vfloat sdf_power(vfloat power, const struct primitive *s) {
    COUNT(sdf_power, call);
    return power / (v_sqrt(v_max(power + v_splat(s->sphere.radius_sq), v_splat(0.0f))) +
                    v_splat(s->sphere.radius));
}

static inline vfloat sdf_octahedron(struct vec point, const struct primitive *s) {
    COUNT(sdf_octahedron, call);
    vfloat x = v_abs(point.x), y = v_abs(point.y), z = v_abs(point.z);
    vfloat zero = v_splat(0.0f), radius = v_splat(s->octahedron.radius);
    vfloat m = x + y + z - radius, third = m * v_splat(1.0f / 3.0f);
    vmask over_yz = v_cmp_lt(x, third), over_zx = v_cmp_lt(y, third), over_xy = v_cmp_lt(z, third);
    vfloat face = m * v_splat(0.57735026918962576451f); // 1/√3
    vmask edges = v_or(over_yz, v_or(over_zx, over_xy));
    if (!v_any(edges))
        return face;
    COUNT(sdf_octahedron, edges);
    vfloat a = v_select(over_yz, x, v_select(over_zx, y, z));
    vfloat b = v_select(over_yz, y, v_select(over_zx, z, x));
    vfloat c = v_select(over_yz, z, v_select(over_zx, x, y));
    vfloat k = v_min(v_max(v_splat(0.5f) * (c - b + radius), zero), radius);
    vfloat beside = b - radius + k, above = c - k;
    vfloat edge = v_sqrt(v_madd(a, a, v_madd(beside, beside, above * above)));
    return v_select(edges, edge, face);
}

// The map in the form of phase opt2. Lanes that have escaped, or whose ray is done, keep their
// values (the paper's Fig. 5). Lanes of `done` may return anything.
static inline vfloat sdf_mandelbulb(struct vec p, const struct primitive *s, vmask done) {
    COUNT(sdf_mandelbulb, call);
    vfloat x = p.x, y = p.y, z = p.z, norm_sq = vec_dot(p, p), m = norm_sq, dz = v_splat(1.5f);
    // |w|² grows to |p|^16, which overflows from |p| = 256. From |p| = 32 a single iteration escapes,
    // and the estimate is r·ln(r)/3 to float precision.
    vmask far = v_cmp_gt(m, v_splat(1024.0f)), escaped = v_or(done, far);
    vfloat z2 = z * z;
    for (int i = 0; i < s->mandelbulb.iterations; i++) {
        ACTIVE(LANES - v_count(escaped));
        COUNT(sdf_mandelbulb, iteration);
        vfloat x2 = x * x, y2 = y * y;
        vfloat k3 = x2 + z2, k4 = k3 - y2;
        vfloat inv_k3 = v_select_or_zero(v_cmp_gt(k3, v_splat(1e-36f)), v_splat(1.0f) / k3);
        vfloat k1 = v_madd(k3, k3, y2 * v_nmadd(v_splat(6.0f), k3, y2));
        vfloat cos2 = (x2 - z2) * inv_k3, sin2 = v_splat(2.0f) * (x * z) * inv_k3;
        vfloat cos4 = v_nmadd(sin2 + sin2, sin2, v_splat(1.0f)), sin4 = (sin2 + sin2) * cos2;
        vfloat k2 = v_splat(8.0f) * y * k4 * k1 * v_sqrt(k3), k2_sin4 = k2 * (sin4 + sin4);
        x = v_madd(k2_sin4, cos4, p.x);      // p.x + k2·sin8
        z = v_madd(k2_sin4, sin4, p.z - k2); // p.z − k2·cos8
        y = v_madd(k1, k1, v_nmadd(v_splat(16.0f) * y2 * k3, k4 * k4, p.y));
        // Last, because the next steps do not wait for its root.
        vfloat slope = v_madd(v_splat(8.0f) * (m * m * m * v_sqrt(m)), dz, v_splat(1.0f));
        z2 = z * z;
        vfloat grown = v_madd(x, x, v_madd(y, y, z2));
        m = v_select(escaped, m, grown);
        dz = v_select(escaped, dz, slope);
        escaped = v_or(escaped, v_cmp_gt(m, v_splat(s->mandelbulb.bailout)));
        if (v_all(escaped))
            break;
    }
    ACTIVE(LANES - v_count(v_or(done, far)));
    COUNT(sdf_mandelbulb, estimate);
    // The division does not depend on the logarithm, so both run at once.
    vfloat distance = v_splat(0.25f) * v_sqrt(m) / dz * log_of(m);
    if (v_any(far)) {
        ACTIVE(v_count(v_andnot(done, far)));
        COUNT(sdf_mandelbulb, far);
        vfloat r = v_sqrt(norm_sq);
        distance = v_select(far, r * log_of(r) * v_splat(1.0f / 3.0f), distance);
    }
    ACTIVE(LANES - v_count(done));
    return v_select_or_zero(v_cmp_gt(m, v_splat(0.0f)), distance); // √m·ln m → 0 at the centre
}

// The shape's distance at a point of its frame. Precondition: p lies in the central cell if the
// shape is repeated.
__attribute__((always_inline)) static inline vfloat
distance_at(struct vec p, const struct primitive *primitive, vmask done) {
    switch (primitive->type) {
    case SHAPE_SPHERE: return sdf_sphere(p, primitive);
    case SHAPE_BOX: return sdf_box(p, primitive);
    case SHAPE_TORUS: return sdf_torus(p, primitive);
    case SHAPE_CONE: return sdf_cone(p, primitive);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(p, primitive);
    case SHAPE_PLANE: return sdf_plane(p, primitive);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(p, primitive);
    default:
        return primitive->type == SHAPE_MANDELBOX ? sdf_mandelbox(p, primitive)
                                                  : sdf_mandelbulb(p, primitive, done);
    }
}

// The distance to one shape at distance t along the rays.
__attribute__((always_inline)) static inline vfloat
distance_to_shape(const struct local_ray *a, vfloat t, const struct primitive *primitive,
                  vmask done) {
    COUNT(distance_to_shape, call);
    if (primitive->eval != AT_POINT) {
        if (primitive->eval == POWER) {
            COUNT(distance_to_shape, power);
            return sdf_power(v_madd(t, t + a->slope, a->power), primitive);
        }
        COUNT(distance_to_shape, linear);
        return v_madd(t, a->direction.x, a->origin.x);
    }
    COUNT(distance_to_shape, point);
    struct vec p = vec_along(a->origin, a->direction, t);
    if (primitive->repeated)
        p = vec_wrapped(primitive, p);
    return distance_at(p, primitive, done);
}

// Returns the distance to the nearest shape at distance t along the rays. Unless `nearest` is NULL,
// it gets the index of that shape, the first of equals. Lanes of `done` may return anything.
// `groups`: whether the scene has some, a constant of each copy. Inlined: the march keeps its registers.
__attribute__((always_inline)) static inline vfloat sdf(const struct local_ray *rays, vfloat t,
                                                        const struct prepared *scene, vmask done,
                                                        bool groups, vfloat *nearest) {
    COUNT(sdf, call);
    vfloat closest = v_splat(INFINITY);
    for (int i = 0; i < scene->model.shape_count; i++) {
        if (groups && scene->primitives[i].type == SHAPE_GROUP)
            continue; // closest_group()
        COUNT(sdf, shape);
        vfloat distance = distance_to_shape(&rays[i], t, &scene->primitives[i], done);
        if (nearest) { // a constant after inlining
            COUNT(sdf, which);
            *nearest = v_select(v_cmp_lt(distance, closest), v_splat(scene->primitives[i].index),
                                *nearest);
        }
        closest = v_min(distance, closest);
    }
    if (groups) {
        struct closest least = {closest, nearest ? *nearest : closest};
        least = closest_group(rays, t, scene, least);
        closest = least.distance;
        if (nearest)
            *nearest = least.shape;
    }
    return closest;
}
