// Signed distances of four points at once. Sphere, box, torus, capped cone, octahedron: I. Quilez,
// "distance functions" (iquilezles.org/articles/distfunctions). Mandelbulb: the power-8 map of
// D. White and P. Nylander without trigonometry, with its running derivative: I. Quilez,
// "mandelbulb" (iquilezles.org/articles/mandelbulb). Mandelbox: T. Lowe (fractalforums.com, 2010), with
// the running derivative of Buddhi and Rrrola (fractalforums.com, 2010). Both are estimates, not bounds.
//
// Where lanes take different branches, every branch is evaluated and a mask selects the result. An
// early exit is taken only when all lanes take it.
#pragma once

#include "scene/scene.h"
#include "vec.h"

// A shape with only what the march evaluates, prepared once per scene.
struct primitive {
    enum shape_type type;
    bool rotated, repeated;
    double index; // in the scene
    double position[3];
    double rotation[3][3]; // rows: the three rotations as one matrix
    double cell[3], inv_cell[3];
#include "scene/primitive_sizes.h"
};

struct prepared {
    struct model model;
    double bounds_sq;
    struct primitive *primitives;     // one per shape
    struct instruction *instructions; // of all groups
};

struct closest {
    vdouble distance, shape;
};

// group.c. Returns the closest shape at the points, of all groups and of `least`, the closest of the others. Apart from
// their loop, which a call in it makes slower; cold, so that it keeps its registers.
struct closest closest_group(struct vec p, const struct prepared *scene, struct closest least)
    __attribute__((cold));

// The points in the shape's frame, wrapped into the central cell if the shape is repeated.
static inline struct vec apply_transform(struct vec point, const struct primitive *primitive) {
    COUNT(apply_transform, call);
    struct vec p = {point.x - v_splat(primitive->position[0]),
                    point.y - v_splat(primitive->position[1]),
                    point.z - v_splat(primitive->position[2])};
    if (primitive->rotated) {
        COUNT(apply_transform, turned);
        struct vec q = p;
        p.x = vec_dot(vec_set(primitive->rotation[0]), q);
        p.y = vec_dot(vec_set(primitive->rotation[1]), q);
        p.z = vec_dot(vec_set(primitive->rotation[2]), q);
    }
    if (primitive->repeated) { // cell 0: no repetition along that axis
        COUNT(apply_transform, repeated);
        vdouble half = v_splat(0.5);
        struct vec cell = vec_set(primitive->cell), inv_cell = vec_set(primitive->inv_cell);
        p.x = v_nmadd(cell.x, v_floor(v_madd(p.x, inv_cell.x, half)), p.x);
        p.y = v_nmadd(cell.y, v_floor(v_madd(p.y, inv_cell.y, half)), p.y);
        p.z = v_nmadd(cell.z, v_floor(v_madd(p.z, inv_cell.z, half)), p.z);
    }
    return p;
}

// Cold: inlined, it takes registers from the marches of other shapes (scene0 5 %).
__attribute__((noinline, cold)) static vdouble sdf_mandelbox(struct vec p,
                                                             const struct primitive *s);
#include "packet/distances.h"

static inline vdouble sdf_octahedron(struct vec point, const struct primitive *s) {
    COUNT(sdf_octahedron, call);
    vdouble x = v_abs(point.x), y = v_abs(point.y), z = v_abs(point.z);
    vdouble zero = v_splat(0.0), radius = v_splat(s->octahedron.radius);
    vdouble m = x + y + z - radius, third = m * v_splat(1.0 / 3.0);
    vmask over_yz = v_cmp_lt(x, third), over_zx = v_cmp_lt(y, third), over_xy = v_cmp_lt(z, third);
    vdouble face = m * v_splat(0.57735026918962576451); // 1/√3
    vmask edges = v_or(over_yz, v_or(over_zx, over_xy));
    if (!v_any(edges))
        return face;
    COUNT(sdf_octahedron, edges);
    vdouble a = v_select(over_yz, x, v_select(over_zx, y, z));
    vdouble b = v_select(over_yz, y, v_select(over_zx, z, x));
    vdouble c = v_select(over_yz, z, v_select(over_zx, x, y));
    vdouble k = v_min(v_max(v_splat(0.5) * (c - b + radius), zero), radius);
    vdouble beside = b - radius + k, above = c - k;
    vdouble edge = v_sqrt(v_madd(a, a, v_madd(beside, beside, above * above)));
    return v_select(edges, edge, face);
}

// The map in the form of phase opt2. Lanes that have escaped, or whose ray is done, keep their
// values (the paper's Fig. 5). Lanes of `done` may return anything.
static inline vdouble sdf_mandelbulb(struct vec p, const struct primitive *s, vmask done) {
    COUNT(sdf_mandelbulb, call);
    vdouble x = p.x, y = p.y, z = p.z, m = vec_dot(p, p), dz = v_splat(1.5);
    vmask escaped = done;
    for (int i = 0; i < s->mandelbulb.iterations; i++) {
        ACTIVE(LANES - v_count(escaped));
        COUNT(sdf_mandelbulb, iteration);
        vdouble x2 = x * x, y2 = y * y, z2 = z * z;
        vdouble k3 = x2 + z2, k4 = k3 - y2;
        vdouble inv_k3 =
            v_select_or_zero(v_cmp_gt(k3, v_splat(1e-300)), v_splat(1.0) / k3); // 0 on the axis
        vdouble k1 = v_madd(k3, k3, y2 * v_nmadd(v_splat(6.0), k3, y2));
        vdouble cos2 = (x2 - z2) * inv_k3, sin2 = v_splat(2.0) * (x * z) * inv_k3;
        vdouble cos4 = v_nmadd(sin2 + sin2, sin2, v_splat(1.0)), sin4 = (sin2 + sin2) * cos2;
        vdouble k2 = v_splat(8.0) * y * k4 * k1 * v_sqrt(k3), k2_sin4 = k2 * (sin4 + sin4);
        x = v_madd(k2_sin4, cos4, p.x);      // p.x + k2·sin8
        z = v_madd(k2_sin4, sin4, p.z - k2); // p.z − k2·cos8
        y = v_madd(k1, k1, v_nmadd(v_splat(16.0) * y2 * k3, k4 * k4, p.y));
        // Last, because the next steps do not wait for its root.
        vdouble slope = v_madd(v_splat(8.0) * (m * m * m * v_sqrt(m)), dz, v_splat(1.0));
        vdouble grown = v_madd(x, x, v_madd(y, y, z * z));
        m = v_select(escaped, m, grown);
        dz = v_select(escaped, dz, slope);
        escaped = v_or(escaped, v_cmp_gt(m, v_splat(s->mandelbulb.bailout)));
        if (v_all(escaped))
            break;
    }
    ACTIVE(LANES - v_count(done));
    // The division does not depend on the logarithm, so both run at once.
    vdouble distance = v_splat(0.25) * v_sqrt(m) / dz * log_of(m);
    return v_select_or_zero(v_cmp_gt(m, v_splat(0.0)), distance); // √m·ln m → 0 at the centre
}

__attribute__((always_inline)) static inline vdouble
distance_to_shape(struct vec point, const struct primitive *primitive, vmask done) {
    struct vec p = apply_transform(point, primitive);
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

// Returns the distance to the nearest shape. `nearest` gets the index of that shape, the first of
// equals. Lanes of `done` may return anything. Always inlined: a call would pass the three vectors
// through memory at every step, which cost 28 % of scene0's time and 24 % of the Mandelbulb's
// (n = 180). `groups`: whether the scene has groups, a constant of each copy of the caller.
__attribute__((always_inline)) static inline vdouble
sdf(struct vec p, const struct prepared *scene, vmask done, bool groups, vdouble *nearest) {
    COUNT(sdf, call);
    vdouble closest = v_splat(INFINITY);
    for (int i = 0; i < scene->model.shape_count; i++) {
        if (groups && scene->primitives[i].type == SHAPE_GROUP)
            continue; // closest_group()
        COUNT(sdf, shape);
        vdouble distance = distance_to_shape(p, &scene->primitives[i], done);
        vmask closer = v_cmp_lt(distance, closest);
        closest = v_min(distance, closest);
        *nearest = v_select(closer, v_splat(scene->primitives[i].index), *nearest);
    }
    if (groups) {
        struct closest least = closest_group(p, scene, (struct closest){closest, *nearest});
        closest = least.distance;
        *nearest = least.shape;
    }
    return closest;
}
