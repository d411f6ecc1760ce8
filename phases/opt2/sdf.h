// Signed distances. Sphere, box, torus, capped cone, octahedron: I. Quilez, "distance functions"
// (iquilezles.org/articles/distfunctions). Mandelbulb: the power-8 map of D. White and P. Nylander
// without trigonometry, with its running derivative: I. Quilez, "mandelbulb"
// (iquilezles.org/articles/mandelbulb). Mandelbox: T. Lowe (fractalforums.com, 2010), with the running
// derivative of Buddhi and Rrrola (fractalforums.com, 2010). Both are estimates, not bounds.
//
// All functions are inlined. phase_prepare() computes everything that does not depend on the point.
#pragma once

#include "scene/scene.h"
#include "vec.h"

typedef double real;

// A shape with only what the march evaluates, prepared once per scene.
struct primitive {
    enum shape_type type;
    bool rotated, repeated;
    double position[3];
    double rotation[3][3]; // rows: the three rotations as one matrix
    double cell[3], inv_cell[3];
#include "scene/primitive_sizes.h"
};

#include "scene/instruction.h" // needs struct primitive

struct prepared {
    struct model model;
    double bounds_sq;
    struct primitive *primitives;     // one per shape
    struct instruction *instructions; // of all groups
};

// group.c: the field over its Lipschitz constant at a point of the group's frame; the material at a point of the world.
double sdf_group(const double *p, const struct primitive *group);
void group_surface(const double *point, const struct primitive *group, const struct model *model,
                   struct material *surface);

static inline double min_of(double a, double b) {
    return a < b ? a : b;
}

static inline double max_of(double a, double b) {
    return a > b ? a : b;
}

static inline double clamp(double x, double low, double high) {
    return min_of(max_of(x, low), high);
}

// The point in the shape's frame, wrapped into the central cell if the shape is repeated.
static inline void apply_transform(const double *point, const struct primitive *primitive,
                                   double *p) {
    COUNT(apply_transform, call);
    double q[3];
    for (int i = 0; i < 3; i++)
        q[i] = p[i] = point[i] - primitive->position[i];
    if (primitive->rotated) {
        COUNT(apply_transform, turn);
        for (int i = 0; i < 3; i++)
            p[i] = vec_dot(primitive->rotation[i], q);
    }
    if (primitive->repeated) { // cell 0: no repetition along that axis
        COUNT(apply_transform, wrap);
        for (int i = 0; i < 3; i++)
            p[i] -= primitive->cell[i] * floor(p[i] * primitive->inv_cell[i] + 0.5);
    }
}

static inline double sdf_sphere(const double *p, const struct primitive *s) {
    COUNT(sdf_sphere, call);
    return vec_norm(p) - s->sphere.radius;
}

static inline double sdf_plane(const double *p, const struct primitive *s) {
    COUNT(sdf_plane, call);
    return vec_dot(p, s->plane.normal) - s->plane.offset;
}

static inline double sdf_box(const double *p, const struct primitive *s) {
    COUNT(sdf_box, call);
    double q[3], outside[3];
    for (int i = 0; i < 3; i++) {
        q[i] = fabs(p[i]) - s->box.half_size[i];
        outside[i] = max_of(q[i], 0.0);
        if (outside[i] == 0.0)
            COUNT(sdf_box, within);
    }
    return vec_norm(outside) + min_of(max_of(q[0], max_of(q[1], q[2])), 0.0);
}

static inline double sdf_rounded_box(const double *p, const struct primitive *s) {
    COUNT(sdf_rounded_box, call);
    return sdf_box(p, s) - s->box.rounding;
}

static inline double sdf_torus(const double *p, const struct primitive *s) {
    COUNT(sdf_torus, call);
    double ring = sqrt(p[0] * p[0] + p[2] * p[2]) - s->torus.major_radius;
    return sqrt(ring * ring + p[1] * p[1]) - s->torus.minor_radius;
}

static inline double sdf_cone(const double *p, const struct primitive *s) {
    COUNT(sdf_cone, call);
    double radius = sqrt(p[0] * p[0] + p[2] * p[2]);
    double x = radius - s->cone.top_radius, y = p[1] - s->cone.half_height; // from the top rim
    double rim = p[1] < 0.0 ? s->cone.bottom_radius : (COUNT(sdf_cone, upper), s->cone.top_radius);
    double cap_x = max_of(radius - rim, 0.0), cap_y = fabs(p[1]) - s->cone.half_height;
    double along =
        clamp(-(x * s->cone.side[0] + y * s->cone.side[1]) * s->cone.inv_side_sq, 0.0, 1.0);
    if (along == 1.0)
        COUNT(sdf_cone, top);
    if (cap_x == 0.0)
        COUNT(sdf_cone, under);
    double side_x = x + s->cone.side[0] * along, side_y = y + s->cone.side[1] * along;
    double sign = 1.0 - 2.0 * (side_x < 0.0 && (COUNT(sdf_cone, beside), cap_y < 0.0));
    return sign * sqrt(min_of(cap_x * cap_x + cap_y * cap_y, side_x * side_x + side_y * side_y));
}

static inline double sdf_octahedron(const double *point, const struct primitive *s) {
    COUNT(sdf_octahedron, call);
    double x = fabs(point[0]), y = fabs(point[1]), z = fabs(point[2]);
    double m = x + y + z - s->octahedron.radius, third = m * (1.0 / 3.0);
    double q[3];
    // The conditions in the order of how often they hold on scene0 (n = 120): y 1.63, x 0.97, z 0.40,
    // none 0.05 million times. Where two hold, the nearest point is a vertex and both give it.
    if (y < third)
        q[0] = y, q[1] = z, q[2] = x;
    else if (x < third)
        q[0] = x, q[1] = y, q[2] = z;
    else if (z < third)
        q[0] = z, q[1] = x, q[2] = y;
    else
        return COUNT(sdf_octahedron, face), m * 0.57735026918962576451; // 1/√3: nearest to a face
    COUNT(sdf_octahedron, edge);
    double k = clamp(0.5 * (q[2] - q[1] + s->octahedron.radius), 0.0, s->octahedron.radius);
    double edge[3] = {q[0], q[1] - s->octahedron.radius + k, q[2] - k};
    return vec_norm(edge);
}

// The iteration's variables: w = (x, y, z), m = |w|², dz = |dw/dp|.
struct bulb {
    double x, y, z, m, dz;
};

// One step of the map. With Quilez's k1, k3 and k4, (x² − z², 2xz)/k3 is the unit phasor of twice the
// azimuth. Doubled two more times, by cos 2a = 1 − 2 sin² a and sin 2a = 2 sin a cos a, it replaces
// his products of degree nine. Always inlined: it counts as sdf_mandelbulb().
__attribute__((__always_inline__)) static inline void bulb_step(const double *p, struct bulb *at) {
    COUNT(sdf_mandelbulb, step);
    double x = at->x, y = at->y, z = at->z, m = at->m, dz = at->dz;
    double root = sqrt(m);
    dz = 8.0 * (m * m * m * root) * dz + 1.0;
    double x2 = x * x, y2 = y * y, z2 = z * z;
    double k3 = x2 + z2, k4 = k3 - y2;
    // On the axis, 0.
    double inv_k3 = k3 > 1e-300 ? (COUNT(sdf_mandelbulb, off_axis), 1.0 / k3) : 0.0;
    double k1 = k3 * k3 + y2 * (y2 - 6.0 * k3);
    double cos2 = (x2 - z2) * inv_k3, sin2 = 2.0 * (x * z) * inv_k3;
    double cos4 = 1.0 - 2.0 * sin2 * sin2, sin4 = 2.0 * sin2 * cos2;
    double k2 = 8.0 * y * k4 * k1 * sqrt(k3), k2_sin4 = k2 * (2.0 * sin4);
    x = p[0] + k2_sin4 * cos4;
    y = p[1] + k1 * k1 - 16.0 * y2 * k3 * (k4 * k4);
    z = p[2] - k2 + k2_sin4 * sin4;
    m = x * x + y * y + z * z;
    *at = (struct bulb){x, y, z, m, dz};
}

// The distance estimate 0.25·√m·ln m / dz, which is 0 at the centre.
static inline double sdf_mandelbulb(const double *p, const struct primitive *s) {
    COUNT(sdf_mandelbulb, call);
    struct bulb bulb = {p[0], p[1], p[2], p[0] * p[0] + p[1] * p[1] + p[2] * p[2], 1.5};
    double bailout = s->mandelbulb.bailout;
    // Unrolled by four, which is the paper's number of iterations.
    for (int i = s->mandelbulb.iterations;; i -= 4) {
        bulb_step(p, &bulb);
        if (bulb.m > bailout || i == 1)
            break;
        bulb_step(p, &bulb);
        if (bulb.m > bailout || i == 2)
            break;
        bulb_step(p, &bulb);
        if (bulb.m > bailout || i == 3)
            break;
        bulb_step(p, &bulb);
        if (bulb.m > bailout || i == 4)
            break;
    }
    double m = bulb.m;
    return m > 0.0 ? (COUNT(sdf_mandelbulb, off_centre), 0.25 * sqrt(m) / bulb.dz * log(m)) : 0.0;
}

// The Mandelbox's map folds the point at the planes ±fold_limit, inverts it in the sphere of fixed_radius,
// scales it and adds p. dr is the most by which the iterations stretch a distance.
static inline double sdf_mandelbox(const double *p, const struct primitive *s) {
    COUNT(sdf_mandelbox, call);
    double limit = s->mandelbox.fold_limit, scale = s->mandelbox.scale;
    double outer_sq = s->mandelbox.outer_sq;
    double w[3] = {p[0], p[1], p[2]}, dr = 1.0;
    for (int i = 0; i < s->mandelbox.iterations; i++) {
        COUNT(sdf_mandelbox, step);
        for (int k = 0; k < 3; k++) {
            double nearest = clamp(w[k], -limit, limit);
            w[k] = nearest + nearest - w[k];
        }
        double norm_sq = clamp(vec_dot(w, w), s->mandelbox.inner_sq, outer_sq);
        double factor = scale * (outer_sq / norm_sq);
        vec_along(p, w, factor, w);
        dr = fabs(factor) * dr + 1.0;
    }
    return vec_norm(w) / dr;
}

static inline double distance_to_shape(const double *point, const struct primitive *primitive) {
    COUNT(distance_to_shape, call);
    double p[3];
    apply_transform(point, primitive, p);
    switch (primitive->type) {
    case SHAPE_SPHERE: return sdf_sphere(p, primitive);
    case SHAPE_BOX: return sdf_box(p, primitive);
    case SHAPE_TORUS: return sdf_torus(p, primitive);
    case SHAPE_CONE: return sdf_cone(p, primitive);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(p, primitive);
    case SHAPE_PLANE: return sdf_plane(p, primitive);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(p, primitive);
    case SHAPE_MANDELBOX: return sdf_mandelbox(p, primitive);
    case SHAPE_GROUP: { // a copy: p stays in registers
        double q[3] = {p[0], p[1], p[2]};
        return sdf_group(q, primitive);
    }
    default: return sdf_mandelbulb(p, primitive);
    }
}

// Returns the distance to the nearest shape. `nearest` gets its index, the first of equals.
static inline double sdf(const double *p, const struct prepared *scene, int *nearest) {
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
