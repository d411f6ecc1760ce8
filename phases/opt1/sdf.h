// Signed distances. Sphere, box, torus, capped cone, octahedron: I. Quilez, "distance functions"
// (iquilezles.org/articles/distfunctions). Mandelbulb: the power-8 map of D. White and P. Nylander
// without trigonometry, with its running derivative: I. Quilez, "mandelbulb"
// (iquilezles.org/articles/mandelbulb). Mandelbox: T. Lowe (fractalforums.com, 2010), with the running
// derivative of Buddhi and Rrrola (fractalforums.com, 2010). Both are estimates, not bounds.
//
// phase_prepare() computes the sines and cosines. A rotation or repetition that a shape lacks is not
// evaluated.
#pragma once

#include "group.h"
#include "scene/scene.h"
#include "vec.h"

CALL double clamp(double x, double low, double high) {
    COUNT(clamp, call);
    return x < low ? low : (COUNT(clamp, not_below), x > high ? high : x);
}

// A shape with its rotations, prepared once per scene. A rotation takes (u, v) to
// (c·u − s·v, s·u + c·v), on (y,z), then (x,z), then (x,y).
struct primitive {
    struct shape shape;
    struct vec3 position;
    double cosine[3], sine[3];
    bool rotated[3], repeated;
    const struct group_node *nodes; // the scene's, of a group
};

struct prepared {
    struct model model;
    struct primitive *primitives; // one per shape
    struct group_node *nodes;     // one per node
};

// The coordinate within its cell, −cell/2 ... cell/2. Cell 0 means no repetition.
static inline double wrap(double x, double cell) {
    return cell > 0 ? (COUNT(apply_transform, wrap), x - cell * floor(x / cell + 0.5)) : x;
}

// The point in the shape's frame, wrapped into the central cell if the shape is repeated.
static inline void apply_transform(const struct vec3 *point, const struct primitive *primitive,
                                   struct vec3 *p) {
    COUNT(apply_transform, call);
    const double *c = primitive->cosine, *s = primitive->sine;
    p->x = point->x - primitive->position.x;
    p->y = point->y - primitive->position.y;
    p->z = point->z - primitive->position.z;
    if (primitive->rotated[0]) {
        COUNT(apply_transform, turn);
        double y = p->y;
        p->y = c[0] * y - s[0] * p->z;
        p->z = s[0] * y + c[0] * p->z;
    }
    if (primitive->rotated[1]) {
        COUNT(apply_transform, turn);
        double x = p->x;
        p->x = c[1] * x - s[1] * p->z;
        p->z = s[1] * x + c[1] * p->z;
    }
    if (primitive->rotated[2]) {
        COUNT(apply_transform, turn);
        double x = p->x;
        p->x = c[2] * x - s[2] * p->y;
        p->y = s[2] * x + c[2] * p->y;
    }
    if (primitive->repeated) {
        COUNT(apply_transform, repeated);
        p->x = wrap(p->x, primitive->shape.repeat[0]);
        p->y = wrap(p->y, primitive->shape.repeat[1]);
        p->z = wrap(p->z, primitive->shape.repeat[2]);
    }
}

CALL double sdf_sphere(const struct vec3 *p, const struct shape *shape) {
    COUNT(sdf_sphere, call);
    return vec_norm(p) - shape->sphere.radius;
}

CALL double sdf_plane(const struct vec3 *p, const struct shape *shape) {
    COUNT(sdf_plane, call);
    const double *n = shape->plane.normal;
    return p->x * n[0] + p->y * n[1] + p->z * n[2] - shape->plane.offset;
}

CALL double sdf_box(const struct vec3 *p, const struct shape *shape) {
    COUNT(sdf_box, call);
    const double *half = shape->box.half_size;
    struct vec3 q;
    vec_abs(p, &q);
    q.x -= half[0];
    q.y -= half[1];
    q.z -= half[2];
    struct vec3 outside = {fmax(q.x, 0.0), fmax(q.y, 0.0), fmax(q.z, 0.0)};
    return vec_norm(&outside) + fmin(fmax(q.x, fmax(q.y, q.z)), 0.0);
}

CALL double sdf_rounded_box(const struct vec3 *p, const struct shape *shape) {
    COUNT(sdf_rounded_box, call);
    return sdf_box(p, shape) - shape->box.rounding;
}

CALL double sdf_torus(const struct vec3 *p, const struct shape *shape) {
    COUNT(sdf_torus, call);
    struct vec3 flat = {p->x, 0.0, p->z};
    struct vec3 section = {vec_norm(&flat) - shape->torus.major_radius, p->y, 0.0};
    return vec_norm(&section) - shape->torus.minor_radius;
}

CALL double sdf_cone(const struct vec3 *p, const struct shape *shape) {
    COUNT(sdf_cone, call);
    double r1 = shape->cone.bottom_radius, r2 = shape->cone.top_radius;
    double h = shape->cone.half_height;
    struct vec3 flat = {p->x, 0.0, p->z};
    struct vec3 q = {vec_norm(&flat), p->y, 0.0};
    struct vec3 k1 = {r2, h, 0.0};
    struct vec3 k2 = {r2 - r1, 2.0 * h, 0.0};
    struct vec3 ca = {q.x - fmin(q.x, q.y < 0.0 ? r1 : r2), fabs(q.y) - h, 0.0};
    struct vec3 from, back, cb;
    vec_sub(&k1, &q, &from);
    vec_sub(&q, &k1, &back);
    vec_along(&back, &k2, clamp(vec_dot(&from, &k2) / vec_dot(&k2, &k2), 0.0, 1.0), &cb);
    double sign = cb.x < 0.0 && ca.y < 0.0 ? -1.0 : 1.0;
    return sign * sqrt(fmin(vec_dot(&ca, &ca), vec_dot(&cb, &cb)));
}

CALL double sdf_octahedron(const struct vec3 *point, const struct shape *shape) {
    COUNT(sdf_octahedron, call);
    double s = shape->octahedron.radius;
    struct vec3 p, q;
    vec_abs(point, &p);
    double m = p.x + p.y + p.z - s;
    if (3.0 * p.x < m)
        q = p;
    else if (COUNT(sdf_octahedron, not_x), 3.0 * p.y < m)
        q = (struct vec3){p.y, p.z, p.x};
    else if (COUNT(sdf_octahedron, not_y), 3.0 * p.z < m)
        q = (struct vec3){p.z, p.x, p.y};
    else
        return COUNT(sdf_octahedron, face), m * 0.57735026918962576451; // 1/√3: nearest to a face
    COUNT(sdf_octahedron, edge);
    double k = clamp(0.5 * (q.z - q.y + s), 0.0, s);
    struct vec3 edge = {q.x, q.y - s + k, q.z - k};
    return vec_norm(&edge);
}

CALL double sdf_mandelbulb(const struct vec3 *p, const struct shape *shape) {
    COUNT(sdf_mandelbulb, call);
    struct vec3 w = *p;
    double m = vec_dot(&w, &w);
    double dz = 1.5;
    for (int i = 0; i < shape->mandelbulb.iterations; i++) {
        COUNT(sdf_mandelbulb, step);
        dz = 8.0 * sqrt(m * m * m * m * m * m * m) * dz + 1.0;
        double x = w.x, x2 = x * x, x4 = x2 * x2;
        double y = w.y, y2 = y * y, y4 = y2 * y2;
        double z = w.z, z2 = z * z, z4 = z2 * z2;
        double k3 = x2 + z2;
        double k7 = k3 * k3 * k3 * k3 * k3 * k3 * k3;
        // On the axis there is no azimuth, and its factor is 0.
        double k2 = k7 > 0.0 ? (COUNT(sdf_mandelbulb, off_axis), 1.0 / sqrt(k7)) : 0.0;
        double k1 = x4 + y4 + z4 - 6.0 * y2 * z2 - 6.0 * x2 * y2 + 2.0 * z2 * x2;
        double k4 = x2 - y2 + z2;
        struct vec3 raised = {
            64.0 * x * y * z * (x2 - z2) * k4 * (x4 - 6.0 * x2 * z2 + z4) * k1 * k2,
            -16.0 * y2 * k3 * k4 * k4 + k1 * k1,
            -8.0 * y * k4 *
                (x4 * x4 - 28.0 * x4 * x2 * z2 + 70.0 * x4 * z4 - 28.0 * x2 * z2 * z4 + z4 * z4) *
                k1 * k2};
        vec_add(p, &raised, &w);
        m = vec_dot(&w, &w);
        if (m > shape->mandelbulb.bailout)
            break;
    }
    // √m·ln m → 0 at the centre.
    return m > 0.0 ? (COUNT(sdf_mandelbulb, off_centre), 0.25 * log(m) * sqrt(m) / dz) : 0.0;
}

// The Mandelbox's map folds the point at the planes ±fold_limit, inverts it in the sphere of fixed_radius,
// scales it and adds p. dr is the most by which the iterations stretch a distance.
CALL double sdf_mandelbox(const struct vec3 *p, const struct shape *shape) {
    COUNT(sdf_mandelbox, call);
    double limit = shape->mandelbox.fold_limit, scale = shape->mandelbox.scale;
    double inner_sq = shape->mandelbox.minimum_radius * shape->mandelbox.minimum_radius;
    double outer_sq = shape->mandelbox.fixed_radius * shape->mandelbox.fixed_radius;
    struct vec3 w = *p;
    double dr = 1.0;
    for (int i = 0; i < shape->mandelbox.iterations; i++) {
        COUNT(sdf_mandelbox, step);
        struct vec3 nearest = {clamp(w.x, -limit, limit), clamp(w.y, -limit, limit),
                               clamp(w.z, -limit, limit)};
        struct vec3 folded = {nearest.x + nearest.x - w.x, nearest.y + nearest.y - w.y,
                              nearest.z + nearest.z - w.z};
        double inversion = outer_sq / clamp(vec_dot(&folded, &folded), inner_sq, outer_sq);
        vec_scale(&folded, scale * inversion, &w);
        vec_add(&w, p, &w);
        dr = fabs(scale * inversion) * dr + 1.0;
    }
    return vec_norm(&w) / dr;
}

// The distance to a solid or plane of a group, whose points are arrays.
static inline double distance_at(const double *at, const struct shape *shape) {
    struct vec3 p = {at[0], at[1], at[2]};
    switch (shape->type) {
    case SHAPE_SPHERE: return sdf_sphere(&p, shape);
    case SHAPE_BOX: return sdf_box(&p, shape);
    case SHAPE_TORUS: return sdf_torus(&p, shape);
    case SHAPE_CONE: return sdf_cone(&p, shape);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(&p, shape);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(&p, shape);
    default: return sdf_plane(&p, shape);
    }
}

static inline double distance_to_shape(const struct vec3 *point,
                                       const struct primitive *primitive) {
    COUNT(distance_to_shape, call);
    struct vec3 p;
    apply_transform(point, primitive, &p);
    switch (primitive->shape.type) {
    case SHAPE_SPHERE: return sdf_sphere(&p, &primitive->shape);
    case SHAPE_BOX: return sdf_box(&p, &primitive->shape);
    case SHAPE_TORUS: return sdf_torus(&p, &primitive->shape);
    case SHAPE_CONE: return sdf_cone(&p, &primitive->shape);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(&p, &primitive->shape);
    case SHAPE_PLANE: return sdf_plane(&p, &primitive->shape);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(&p, &primitive->shape);
    case SHAPE_GROUP:
        return sdf_group((double[3]){p.x, p.y, p.z}, primitive->nodes, primitive->shape.group.root);
    case SHAPE_MANDELBOX: return sdf_mandelbox(&p, &primitive->shape);
    default: return sdf_mandelbulb(&p, &primitive->shape);
    }
}

// Returns the material of a shape's surface near the point.
static inline struct material material_at(const struct vec3 *point,
                                          const struct primitive *primitive,
                                          const struct material *materials) {
    const struct shape *shape = &primitive->shape;
    if (shape->type != SHAPE_GROUP)
        return materials[shape->material];
    struct vec3 p;
    apply_transform(point, primitive, &p);
    return group_material((double[3]){p.x, p.y, p.z}, primitive->nodes, shape->group.root,
                          materials);
}

// Returns the distance to the nearest shape. `nearest` gets its index, the first of equals.
CALL double sdf(const struct vec3 *p, const struct prepared *scene, int *nearest) {
    COUNT(sdf, call);
    double closest = INFINITY;
    for (int i = 0; i < scene->model.shape_count; i++) {
        COUNT(sdf, shape);
        double distance = distance_to_shape(p, &scene->primitives[i]);
        if (distance < closest) {
            closest = distance;
            *nearest = i;
        }
    }
    return closest;
}
