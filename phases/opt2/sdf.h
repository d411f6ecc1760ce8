// Signed distances. Sphere, box, torus, capped cone, octahedron: I. Quilez, "distance functions"
// (iquilezles.org/articles/distfunctions). Mandelbulb: D. White and P. Nylander's power-8 map in
// its trigonometry-free form with the running derivative, I. Quilez, "mandelbulb"
// (iquilezles.org/articles/mandelbulb); it is an estimate, not a bound.
//
// Inlined, with what does not depend on the point worked out by prepare().
#ifndef OPT2_SDF_H
#define OPT2_SDF_H

#include "scene/scene.h"
#include "vec.h"

// A shape as the march wants it: what is evaluated, and nothing else.
struct placed {
    enum shape_type type;
    bool turned, repeated;
    double position[3];
    double turn[3][3]; // rows: the three rotations as one matrix
    double cell[3], per_cell[3];
    double a, b, c;                // sizes: see place_shape() in render.c
    double slope[2], per_slope_sq; // cone: from the bottom rim to the top rim, 1/|slope|²
    double size[3];                // box: half size; plane: normal
    double bailout;
    int iterations;
};

struct prepared {
    struct model model;
    double bounds_sq;
    struct placed *placed; // one per shape
};

static inline double least_of(double a, double b) {
    return a < b ? a : b;
}

static inline double most_of(double a, double b) {
    return a > b ? a : b;
}

static inline double clamp(double x, double low, double high) {
    return least_of(most_of(x, low), high);
}

// The point in the shape's own frame.
static inline void apply_transform(const double *point, const struct placed *placed, double *p) {
    COUNT(apply_transform, call);
    double q[3];
    for (int i = 0; i < 3; i++)
        q[i] = p[i] = point[i] - placed->position[i];
    if (placed->turned) {
        COUNT(apply_transform, turn);
        for (int i = 0; i < 3; i++)
            p[i] = vec_dot(placed->turn[i], q);
    }
    if (placed->repeated) { // an axis without repetition has cell 0
        COUNT(apply_transform, wrap);
        for (int i = 0; i < 3; i++)
            p[i] -= placed->cell[i] * floor(p[i] * placed->per_cell[i] + 0.5);
    }
}

static inline double sdf_sphere(const double *p, const struct placed *s) {
    COUNT(sdf_sphere, call);
    return vec_norm(p) - s->a;
}

static inline double sdf_plane(const double *p, const struct placed *s) {
    COUNT(sdf_plane, call);
    return vec_dot(p, s->size) - s->a;
}

static inline double sdf_box(const double *p, const struct placed *s) {
    COUNT(sdf_box, call);
    double q[3], outside[3];
    for (int i = 0; i < 3; i++) {
        q[i] = fabs(p[i]) - s->size[i];
        outside[i] = most_of(q[i], 0.0);
        if (outside[i] == 0.0)
            COUNT(sdf_box, within);
    }
    return vec_norm(outside) + least_of(most_of(q[0], most_of(q[1], q[2])), 0.0);
}

static inline double sdf_rounded_box(const double *p, const struct placed *s) {
    COUNT(sdf_rounded_box, call);
    return sdf_box(p, s) - s->a;
}

static inline double sdf_torus(const double *p, const struct placed *s) {
    COUNT(sdf_torus, call);
    double ring = sqrt(p[0] * p[0] + p[2] * p[2]) - s->a;
    return sqrt(ring * ring + p[1] * p[1]) - s->b;
}

static inline double sdf_cone(const double *p, const struct placed *s) {
    COUNT(sdf_cone, call);
    double radius = sqrt(p[0] * p[0] + p[2] * p[2]);
    double x = radius - s->b, y = p[1] - s->c; // from the top rim
    double rim = p[1] < 0.0 ? s->a : (COUNT(sdf_cone, upper), s->b);
    double cap_x = most_of(radius - rim, 0.0), cap_y = fabs(p[1]) - s->c;
    double along = clamp(-(x * s->slope[0] + y * s->slope[1]) * s->per_slope_sq, 0.0, 1.0);
    if (along == 1.0)
        COUNT(sdf_cone, top);
    if (cap_x == 0.0)
        COUNT(sdf_cone, under);
    double side_x = x + s->slope[0] * along, side_y = y + s->slope[1] * along;
    double sign = 1.0 - 2.0 * (side_x < 0.0 && (COUNT(sdf_cone, beside), cap_y < 0.0));
    return sign * sqrt(least_of(cap_x * cap_x + cap_y * cap_y, side_x * side_x + side_y * side_y));
}

static inline double sdf_octahedron(const double *point, const struct placed *s) {
    COUNT(sdf_octahedron, call);
    double x = fabs(point[0]), y = fabs(point[1]), z = fabs(point[2]);
    double m = x + y + z - s->a, third = m * (1.0 / 3.0);
    double q[3];
    // In the order of how often they hold on scene0: y 1.63, x 0.97, z 0.40, none 0.05 million
    // times at n = 120. Where two hold the nearest point is a vertex, and either serves.
    if (y < third)
        q[0] = y, q[1] = z, q[2] = x;
    else if (x < third)
        q[0] = x, q[1] = y, q[2] = z;
    else if (z < third)
        q[0] = z, q[1] = x, q[2] = y;
    else
        return COUNT(sdf_octahedron, face), m * 0.57735026918962576451; // 1/√3: above a face
    COUNT(sdf_octahedron, edge);
    double k = clamp(0.5 * (q[2] - q[1] + s->a), 0.0, s->a);
    double edge[3] = {q[0], q[1] - s->a + k, q[2] - k};
    return vec_norm(edge);
}

// One step of the map. With k1, k3, k4 as Quilez has them, (x² − z², 2xz)/k3 is the unit phasor of
// twice the azimuth; doubled twice more by cos 2a = 1 − 2 sin² a and sin 2a = 2 sin a cos a it
// stands for his products of ninth degree.
#define BULB_STEP                                                                                  \
    COUNT(sdf_mandelbulb, step);                                                                   \
    root = sqrt(m);                                                                                \
    dz = 8.0 * (m * m * m * root) * dz + 1.0;                                                      \
    x2 = x * x, y2 = y * y, z2 = z * z;                                                            \
    k3 = x2 + z2, k4 = k3 - y2;                                                                    \
    per_k3 = k3 > 1e-300 ? (COUNT(sdf_mandelbulb, off_axis), 1.0 / k3) : 0.0; /* 0 on the axis */  \
    k1 = k3 * k3 + y2 * (y2 - 6.0 * k3);                                                           \
    cos2 = (x2 - z2) * per_k3, sin2 = 2.0 * (x * z) * per_k3;                                      \
    cos4 = 1.0 - 2.0 * sin2 * sin2, sin4 = 2.0 * sin2 * cos2;                                      \
    k2 = 8.0 * y * k4 * k1 * sqrt(k3), k2_sin4 = k2 * (2.0 * sin4);                                \
    x = p[0] + k2_sin4 * cos4;                                                                     \
    y = p[1] + k1 * k1 - 16.0 * y2 * k3 * (k4 * k4);                                               \
    z = p[2] - k2 + k2_sin4 * sin4;                                                                \
    m = x * x + y * y + z * z;

static inline double sdf_mandelbulb(const double *p, const struct placed *s) {
    COUNT(sdf_mandelbulb, call);
    double x = p[0], y = p[1], z = p[2], m = x * x + y * y + z * z, dz = 1.5;
    double root, x2, y2, z2, k1, k2, k3, k4, per_k3, k2_sin4, cos2, sin2, cos4, sin4;
    for (int i = s->iterations;; i -= 4) { // unrolled by four, the paper's number of iterations
        BULB_STEP
        if (m > s->bailout || i == 1)
            break;
        BULB_STEP
        if (m > s->bailout || i == 2)
            break;
        BULB_STEP
        if (m > s->bailout || i == 3)
            break;
        BULB_STEP
        if (m > s->bailout || i == 4)
            break;
    }
    // √m·ln m → 0 at the centre.
    return m > 0.0 ? (COUNT(sdf_mandelbulb, off_centre), 0.25 * sqrt(m) / dz * log(m)) : 0.0;
}

static inline double distance_to_shape(const double *point, const struct placed *placed) {
    COUNT(distance_to_shape, call);
    double p[3];
    apply_transform(point, placed, p);
    switch (placed->type) {
    case SHAPE_SPHERE: return sdf_sphere(p, placed);
    case SHAPE_BOX: return sdf_box(p, placed);
    case SHAPE_TORUS: return sdf_torus(p, placed);
    case SHAPE_CONE: return sdf_cone(p, placed);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(p, placed);
    case SHAPE_PLANE: return sdf_plane(p, placed);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(p, placed);
    default: return sdf_mandelbulb(p, placed);
    }
}

// Distance to the nearest shape, and which one it is (the first of equals).
static inline double sdf(const double *p, const struct prepared *scene, int *nearest) {
    COUNT(sdf, call);
    double least = INFINITY;
    for (int i = 0; i < scene->model.shape_count; i++) {
        COUNT(sdf, shape);
        double distance = distance_to_shape(p, &scene->placed[i]);
        if (distance < least) {
            least = distance;
            *nearest = i;
        }
    }
    return least;
}

#endif
