// Signed distances. Sphere, box, torus, capped cone, octahedron: I. Quilez, "distance functions"
// (iquilezles.org/articles/distfunctions). Mandelbulb: the power-8 map of D. White and P. Nylander
// without trigonometry, with its running derivative: I. Quilez, "mandelbulb"
// (iquilezles.org/articles/mandelbulb). Mandelbox: T. Lowe (fractalforums.com, 2010), with the running
// derivative of Buddhi and Rrrola (fractalforums.com, 2010). Both are estimates, not bounds.
//
// Naive on purpose: points and the scene go by value through calls. Every evaluation converts the
// angles to radians and takes their sines and cosines.
#pragma once

#include "scene/scene.h"
#include "vec.h"

CALL double clamp(double x, double low, double high) {
    COUNT(clamp, call);
    return x < low ? low : (COUNT(clamp, not_below), x > high ? high : x);
}

// The point rotated about x, then y, then z: (u, v) to (c·u − s·v, s·u + c·v), on (y,z), then (x,z),
// then (x,y).
CALL struct vec3 rotate_point(struct vec3 p, struct vec3 degrees) {
    COUNT(rotate_point, call);
    double ax = degrees.x * (M_PI / 180.0), cx = cos(ax), sx = sin(ax);
    p = (struct vec3){p.x, cx * p.y - sx * p.z, sx * p.y + cx * p.z};
    double ay = degrees.y * (M_PI / 180.0), cy = cos(ay), sy = sin(ay);
    p = (struct vec3){cy * p.x - sy * p.z, p.y, sy * p.x + cy * p.z};
    double az = degrees.z * (M_PI / 180.0), cz = cos(az), sz = sin(az);
    return new_vector(cz * p.x - sz * p.y, sz * p.x + cz * p.y, p.z);
}

// The coordinate within its cell, −cell/2 ... cell/2. Cell 0 means no repetition.
static inline double wrap(double x, double cell) {
    return cell > 0 ? (COUNT(apply_transform, wrap), x - cell * floor(x / cell + 0.5)) : x;
}

// The point wrapped into the central cell. It is called for repeated shapes only, so that other shapes
// do not pay for it.
CALL struct vec3 repeat_point(struct vec3 p, const double cell[3]) {
    COUNT(apply_transform, repeated);
    return (struct vec3){wrap(p.x, cell[0]), wrap(p.y, cell[1]), wrap(p.z, cell[2])};
}

// The point in the shape's frame. Inlined into sdf(), as the paper's compiler does. It takes a pointer,
// because gcc copies the arguments of an inlined function, too.
static inline struct vec3 apply_transform(const struct vec3 *point, const struct shape *shape) {
    COUNT(apply_transform, call);
    struct vec3 p = vec_sub(*point, *vec_at(shape->position));
    p = rotate_point(p, *vec_at(shape->rotation_degrees));
    const double *cell = shape->repeat;
    if (cell[0] > 0 || cell[1] > 0 || cell[2] > 0)
        p = repeat_point(p, cell);
    return p;
}

CALL double sdf_sphere(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_sphere, call);
    return vec_norm(p) - shape->sphere.radius;
}

CALL double sdf_plane(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_plane, call);
    return vec_dot(p, *vec_at(shape->plane.normal)) - shape->plane.offset;
}

CALL double sdf_box(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_box, call);
    struct vec3 q = vec_sub(vec_abs(p), *vec_at(shape->box.half_size));
    struct vec3 outside = new_vector(fmax(q.x, 0.0), fmax(q.y, 0.0), fmax(q.z, 0.0));
    return vec_norm(outside) + fmin(fmax(q.x, fmax(q.y, q.z)), 0.0);
}

CALL double sdf_rounded_box(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_rounded_box, call);
    return sdf_box(p, shape) - shape->box.rounding;
}

CALL double sdf_torus(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_torus, call);
    double ring = vec_norm(new_vector(p.x, 0.0, p.z)) - shape->torus.major_radius;
    return vec_norm(new_vector(ring, p.y, 0.0)) - shape->torus.minor_radius;
}

CALL double sdf_cone(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_cone, call);
    double r1 = shape->cone.bottom_radius, r2 = shape->cone.top_radius, h = shape->cone.half_height;
    struct vec3 q = new_vector(vec_norm(new_vector(p.x, 0.0, p.z)), p.y, 0.0);
    struct vec3 k1 = new_vector(r2, h, 0.0);
    struct vec3 k2 = new_vector(r2 - r1, 2.0 * h, 0.0);
    struct vec3 ca = new_vector(q.x - fmin(q.x, q.y < 0.0 ? r1 : r2), fabs(q.y) - h, 0.0);
    double along = clamp(vec_dot(vec_sub(k1, q), k2) / vec_dot(k2, k2), 0.0, 1.0);
    struct vec3 cb = vec_add(vec_sub(q, k1), vec_scale(k2, along));
    double sign = cb.x < 0.0 && ca.y < 0.0 ? -1.0 : 1.0;
    return sign * sqrt(fmin(vec_dot(ca, ca), vec_dot(cb, cb)));
}

CALL double sdf_octahedron(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_octahedron, call);
    double s = shape->octahedron.radius;
    struct vec3 q;
    p = vec_abs(p);
    double m = p.x + p.y + p.z - s;
    if (3.0 * p.x < m)
        q = p;
    else if (COUNT(sdf_octahedron, not_x), 3.0 * p.y < m)
        q = new_vector(p.y, p.z, p.x);
    else if (COUNT(sdf_octahedron, not_y), 3.0 * p.z < m)
        q = new_vector(p.z, p.x, p.y);
    else
        return COUNT(sdf_octahedron, face), m * 0.57735026918962576451; // 1/√3: nearest to a face
    COUNT(sdf_octahedron, edge);
    double k = clamp(0.5 * (q.z - q.y + s), 0.0, s);
    return vec_norm(new_vector(q.x, q.y - s + k, q.z - k));
}

CALL double sdf_mandelbulb(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_mandelbulb, call);
    struct vec3 w = p;
    double m = vec_dot(w, w);
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
        w.x = p.x + 64.0 * x * y * z * (x2 - z2) * k4 * (x4 - 6.0 * x2 * z2 + z4) * k1 * k2;
        w.y = p.y + (-16.0 * y2 * k3 * k4 * k4 + k1 * k1);
        w.z = p.z +
              -8.0 * y * k4 *
                  (x4 * x4 - 28.0 * x4 * x2 * z2 + 70.0 * x4 * z4 - 28.0 * x2 * z2 * z4 + z4 * z4) *
                  k1 * k2;
        m = vec_dot(w, w);
        if (m > shape->mandelbulb.bailout)
            break;
    }
    // √m·ln m → 0 at the centre.
    return m > 0.0 ? (COUNT(sdf_mandelbulb, off_centre), 0.25 * log(m) * sqrt(m) / dz) : 0.0;
}

// The Mandelbox's map folds the point at the planes ±fold_limit, inverts it in the sphere of fixed_radius,
// scales it and adds p. dr is the most by which the iterations stretch a distance.
CALL double sdf_mandelbox(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_mandelbox, call);
    double limit = shape->mandelbox.fold_limit, scale = shape->mandelbox.scale;
    double inner_sq = shape->mandelbox.minimum_radius * shape->mandelbox.minimum_radius;
    double outer_sq = shape->mandelbox.fixed_radius * shape->mandelbox.fixed_radius;
    struct vec3 w = p;
    double dr = 1.0;
    for (int i = 0; i < shape->mandelbox.iterations; i++) {
        COUNT(sdf_mandelbox, step);
        struct vec3 nearest = new_vector(clamp(w.x, -limit, limit), clamp(w.y, -limit, limit),
                                         clamp(w.z, -limit, limit));
        w = vec_sub(vec_add(nearest, nearest), w);
        double inversion = outer_sq / clamp(vec_dot(w, w), inner_sq, outer_sq);
        w = vec_add(vec_scale(w, scale * inversion), p);
        dr = fabs(scale * inversion) * dr + 1.0;
    }
    return vec_norm(w) / dr;
}

// The field of a group at a point of its frame, and the material of its surface near a point of the scene (group.c).
double sdf_group(struct vec3 p, const struct shape *shape);
struct material group_material(struct vec3 p, const struct shape *group, const struct model *model);

// The distance function of each type, called by pointer: the paper's shapes carry such a pointer.
static double (*const distance_of[SHAPE_TYPES])(struct vec3, const struct shape *) = {
    [SHAPE_SPHERE] = sdf_sphere,
    [SHAPE_BOX] = sdf_box,
    [SHAPE_TORUS] = sdf_torus,
    [SHAPE_CONE] = sdf_cone,
    [SHAPE_OCTAHEDRON] = sdf_octahedron,
    [SHAPE_PLANE] = sdf_plane,
    [SHAPE_MANDELBULB] = sdf_mandelbulb,
    [SHAPE_MANDELBOX] = sdf_mandelbox,
    [SHAPE_ROUNDED_BOX] = sdf_rounded_box,
    [SHAPE_GROUP] = sdf_group,
};

static inline double distance_to_shape(const struct vec3 *p, const struct shape *shape) {
    COUNT(distance_to_shape, call);
    return distance_of[shape->type](apply_transform(p, shape), shape);
}

// The scene, a count and pointers as in the paper's program. It goes by value at every call.
struct world {
    int shape_count;
    const struct shape *shapes;
    const struct model *model;
    const struct view *view;
};

// Returns the distance to the nearest shape. `nearest` gets its index, the first of equals.
CALL double sdf(struct vec3 p, struct world world, int *nearest) {
    COUNT(sdf, call);
    double closest = INFINITY;
    for (int i = 0; i < world.shape_count; i++) {
        COUNT(sdf, shape);
        double distance = distance_to_shape(&p, &world.shapes[i]);
        if (distance < closest) {
            closest = distance;
            *nearest = i;
        }
    }
    return closest;
}
