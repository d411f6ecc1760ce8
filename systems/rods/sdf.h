// Signed distances. Sphere, box, torus, capped cone, octahedron: I. Quilez, "distance functions"
// (iquilezles.org/articles/distfunctions). Mandelbulb: D. White and P. Nylander's power-8 map in
// its trigonometry-free form with the running derivative, I. Quilez, "mandelbulb"
// (iquilezles.org/articles/mandelbulb). Mandelbox: T. Lowe (fractalforums.com, 2010), with the running
// derivative of Buddhi and Rrrola (fractalforums.com, 2010). Both are estimates, not bounds.
//
// All of it is inlined into the march; what does not depend on the point stands in struct primitive.
#ifndef RODS_SDF_H
#define RODS_SDF_H

#include "scene/scene.h"
#include "settings.h"
#include "vec.h"

// A shape as the march evaluates it, with all that does not depend on the point.
struct primitive {
    enum shape_type type;
    bool rotated, repeated;
    double position[3];
    double rotation[3][3];       // from the scene's axes to the shape's, by rows
    double cell[3], inv_cell[3]; // of a repeated shape; 0 on an axis without repetition
    union {
        struct {
            double radius;
        } sphere, octahedron;
        struct {
            double half_size[3], rounding;
        } box;
        struct {
            double normal[3], offset;
        } plane;
        struct {
            double major_radius, minor_radius;
        } torus;
        struct {
            double bottom_radius, top_radius, half_height;
            double side[2], inv_side_sq; // from the bottom rim to the top rim, and 1/|side|²
        } cone;
        struct {
            double bailout;
            int iterations;
        } mandelbulb;
        struct {
            double scale, fold_limit, inner_sq, outer_sq; // squares of the radii
            int iterations;
        } mandelbox;
    };
};

struct prepared {
    struct model model;
    double bounds_sq;
    struct settings settings;
    char settings_text[128];
    struct primitive *primitives; // one per shape
};

static inline double min(double a, double b) {
    return a < b ? a : b;
}

static inline double max(double a, double b) {
    return a > b ? a : b;
}

static inline double clamp(double x, double low, double high) {
    return min(max(x, low), high);
}

// Moves, rotates and wraps a point into the shape's own frame.
static inline void apply_transform(const double *point, const struct primitive *primitive,
                                   double *p) {
    double q[3];
    for (int i = 0; i < 3; i++)
        q[i] = p[i] = point[i] - primitive->position[i];
    if (primitive->rotated)
        for (int i = 0; i < 3; i++)
            p[i] = vec_dot(primitive->rotation[i], q);
    if (primitive->repeated)
        for (int i = 0; i < 3; i++)
            p[i] -= primitive->cell[i] * floor(p[i] * primitive->inv_cell[i] + 0.5);
}

static inline double sdf_sphere(const double *p, const struct primitive *s) {
    return vec_norm(p) - s->sphere.radius;
}

static inline double sdf_plane(const double *p, const struct primitive *s) {
    return vec_dot(p, s->plane.normal) - s->plane.offset;
}

static inline double sdf_box(const double *p, const struct primitive *s) {
    double q[3], outside[3];
    for (int i = 0; i < 3; i++) {
        q[i] = fabs(p[i]) - s->box.half_size[i];
        outside[i] = max(q[i], 0.0);
    }
    return vec_norm(outside) + min(max(q[0], max(q[1], q[2])), 0.0);
}

static inline double sdf_rounded_box(const double *p, const struct primitive *s) {
    return sdf_box(p, s) - s->box.rounding;
}

static inline double sdf_torus(const double *p, const struct primitive *s) {
    double ring = sqrt(p[0] * p[0] + p[2] * p[2]) - s->torus.major_radius;
    return sqrt(ring * ring + p[1] * p[1]) - s->torus.minor_radius;
}

static inline double sdf_cone(const double *p, const struct primitive *s) {
    double radius = sqrt(p[0] * p[0] + p[2] * p[2]);
    double x = radius - s->cone.top_radius, y = p[1] - s->cone.half_height; // from the top rim
    double rim = p[1] < 0.0 ? s->cone.bottom_radius : s->cone.top_radius;
    double cap_x = max(radius - rim, 0.0), cap_y = fabs(p[1]) - s->cone.half_height;
    double along =
        clamp(-(x * s->cone.side[0] + y * s->cone.side[1]) * s->cone.inv_side_sq, 0.0, 1.0);
    double side_x = x + s->cone.side[0] * along, side_y = y + s->cone.side[1] * along;
    double sign = 1.0 - 2.0 * (side_x < 0.0 && cap_y < 0.0);
    return sign * sqrt(min(cap_x * cap_x + cap_y * cap_y, side_x * side_x + side_y * side_y));
}

static inline double sdf_octahedron(const double *point, const struct primitive *s) {
    double x = fabs(point[0]), y = fabs(point[1]), z = fabs(point[2]);
    double m = x + y + z - s->octahedron.radius, third = m * (1.0 / 3.0);
    double q[3];
    // The likeliest first: on scene0 at n = 120 y holds 1.63, x 0.97, z 0.40 and none 0.05 million times.
    // Where two hold, the nearest point is a vertex, and either edge gives it.
    if (y < third)
        q[0] = y, q[1] = z, q[2] = x;
    else if (x < third)
        q[0] = x, q[1] = y, q[2] = z;
    else if (z < third)
        q[0] = z, q[1] = x, q[2] = y;
    else
        return m * 0.57735026918962576451; // 1/√3: above a face
    double k = clamp(0.5 * (q[2] - q[1] + s->octahedron.radius), 0.0, s->octahedron.radius);
    double edge[3] = {q[0], q[1] - s->octahedron.radius + k, q[2] - k};
    return vec_norm(edge);
}

// The state of the Mandelbulb's iteration: the point w = (x, y, z), m = |w|², and the running derivative.
struct bulb {
    double x, y, z, m, derivative;
};

// Maps w to w⁸ + p and advances the derivative. With k1, k3, k4 as Quilez has them, (x² − z², 2xz)/k3 is the unit
// phasor of twice the azimuth. cos 2a = 1 − 2 sin² a and sin 2a = 2 sin a cos a double it twice. That replaces his
// products of ninth degree.
__attribute__((always_inline)) static inline void bulb_step(struct bulb *w, const double *p) {
    double x = w->x, y = w->y, z = w->z, m = w->m;
    double root = sqrt(m);
    w->derivative = 8.0 * (m * m * m * root) * w->derivative + 1.0;
    double x2 = x * x, y2 = y * y, z2 = z * z;
    double k3 = x2 + z2, k4 = k3 - y2;
    double inv_k3 = k3 > 1e-300 ? 1.0 / k3 : 0.0; // 0 on the axis
    double k1 = k3 * k3 + y2 * (y2 - 6.0 * k3);
    double cos2 = (x2 - z2) * inv_k3, sin2 = 2.0 * (x * z) * inv_k3;
    double cos4 = 1.0 - 2.0 * sin2 * sin2, sin4 = 2.0 * sin2 * cos2;
    double k2 = 8.0 * y * k4 * k1 * sqrt(k3), k2_sin4 = k2 * (2.0 * sin4);
    w->x = p[0] + k2_sin4 * cos4;
    w->y = p[1] + k1 * k1 - 16.0 * y2 * k3 * (k4 * k4);
    w->z = p[2] - k2 + k2_sin4 * sin4;
    w->m = w->x * w->x + w->y * w->y + w->z * w->z;
}

static inline double sdf_mandelbulb(const double *p, const struct primitive *s) {
    struct bulb w = {p[0], p[1], p[2], p[0] * p[0] + p[1] * p[1] + p[2] * p[2], 1.5};
    const double bailout = s->mandelbulb.bailout;
    for (int i = s->mandelbulb.iterations;; i -= 4) { // unrolled by four, the paper's number
        bulb_step(&w, p);
        if (w.m > bailout || i == 1)
            break;
        bulb_step(&w, p);
        if (w.m > bailout || i == 2)
            break;
        bulb_step(&w, p);
        if (w.m > bailout || i == 3)
            break;
        bulb_step(&w, p);
        if (w.m > bailout || i == 4)
            break;
    }
    // √m·ln m → 0 at the centre.
    return w.m > 0.0 ? 0.25 * sqrt(w.m) / w.derivative * log(w.m) : 0.0;
}

// The Mandelbox's map folds the point at the planes ±fold_limit, inverts it in the sphere of fixed_radius,
// scales it and adds p. dr is the most by which the iterations stretch a distance.
static inline double sdf_mandelbox(const double *p, const struct primitive *s) {
    double limit = s->mandelbox.fold_limit, scale = s->mandelbox.scale;
    double outer_sq = s->mandelbox.outer_sq;
    double w[3] = {p[0], p[1], p[2]}, dr = 1.0;
    for (int i = 0; i < s->mandelbox.iterations; i++) {
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

// Returns the signed distance from the point, in the scene's frame, to the shape.
static inline double distance_to_shape(const double *point, const struct primitive *primitive) {
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
    default: return sdf_mandelbulb(p, primitive);
    }
}

// Returns the distance from p to the nearest shape, and its index in `nearest`: the first of equals. In march.c.
double sdf(const double *p, const struct prepared *scene, int *nearest);

#endif
