// Signed distances of four points at once. Sphere, box, torus, capped cone, octahedron: I. Quilez,
// "distance functions" (iquilezles.org/articles/distfunctions). Mandelbulb: D. White and
// P. Nylander's power-8 map in its trigonometry-free form with the running derivative, I. Quilez,
// "mandelbulb" (iquilezles.org/articles/mandelbulb); it is an estimate, not a bound.
//
// Branches that differ between lanes are evaluated for all and chosen by mask; a branch is left
// early only when every lane leaves.
#ifndef OPT3_SDF_H
#define OPT3_SDF_H

#include "scene/scene.h"
#include "vec.h"

// A shape as the march wants it: what is evaluated, and nothing else.
struct placed {
    enum shape_type type;
    bool turned, repeated;
    double index; // in the scene
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

// The points in the shape's own frame.
static inline struct vec apply_transform(struct vec point, const struct placed *placed) {
    COUNT(apply_transform, call);
    struct vec p = {point.x - set(placed->position[0]), point.y - set(placed->position[1]),
                    point.z - set(placed->position[2])};
    if (placed->turned) {
        COUNT(apply_transform, turned);
        struct vec q = p;
        p.x = vec_dot(vec_set(placed->turn[0]), q);
        p.y = vec_dot(vec_set(placed->turn[1]), q);
        p.z = vec_dot(vec_set(placed->turn[2]), q);
    }
    if (placed->repeated) { // an axis without repetition has cell 0
        COUNT(apply_transform, repeated);
        real half = set(0.5);
        struct vec cell = vec_set(placed->cell), per_cell = vec_set(placed->per_cell);
        p.x = neg_mul_add(cell.x, _mm256_floor_pd(mul_add(p.x, per_cell.x, half)), p.x);
        p.y = neg_mul_add(cell.y, _mm256_floor_pd(mul_add(p.y, per_cell.y, half)), p.y);
        p.z = neg_mul_add(cell.z, _mm256_floor_pd(mul_add(p.z, per_cell.z, half)), p.z);
    }
    return p;
}

static inline real sdf_sphere(struct vec p, const struct placed *s) {
    COUNT(sdf_sphere, call);
    return vec_norm(p) - set(s->a);
}

static inline real sdf_plane(struct vec p, const struct placed *s) {
    COUNT(sdf_plane, call);
    return vec_dot(p, vec_set(s->size)) - set(s->a);
}

static inline real sdf_box(struct vec p, const struct placed *s) {
    COUNT(sdf_box, call);
    real zero = set(0.0);
    real x = absolute(p.x) - set(s->size[0]);
    real y = absolute(p.y) - set(s->size[1]);
    real z = absolute(p.z) - set(s->size[2]);
    struct vec outside = {most_of(x, zero), most_of(y, zero), most_of(z, zero)};
    return vec_norm(outside) + least_of(most_of(x, most_of(y, z)), zero);
}

static inline real sdf_rounded_box(struct vec p, const struct placed *s) {
    COUNT(sdf_rounded_box, call);
    return sdf_box(p, s) - set(s->a);
}

static inline real sdf_torus(struct vec p, const struct placed *s) {
    COUNT(sdf_torus, call);
    real ring = root(mul_add(p.x, p.x, p.z * p.z)) - set(s->a);
    return root(mul_add(ring, ring, p.y * p.y)) - set(s->b);
}

static inline real sdf_cone(struct vec p, const struct placed *s) {
    COUNT(sdf_cone, call);
    real zero = set(0.0), one = set(1.0);
    real radius = root(mul_add(p.x, p.x, p.z * p.z));
    real x = radius - set(s->b), y = p.y - set(s->c); // from the top rim
    real rim = choose(less(p.y, zero), set(s->a), set(s->b));
    real cap_x = most_of(radius - rim, zero), cap_y = absolute(p.y) - set(s->c);
    real across = mul_add(x, set(s->slope[0]), y * set(s->slope[1]));
    real along = least_of(most_of(across * set(-s->per_slope_sq), zero), one);
    real side_x = mul_add(set(s->slope[0]), along, x);
    real side_y = mul_add(set(s->slope[1]), along, y);
    mask inside = both(side_x, cap_y); // only the sign bit counts
    real square =
        least_of(mul_add(cap_x, cap_x, cap_y * cap_y), mul_add(side_x, side_x, side_y * side_y));
    return negate_where(inside, root(square));
}

static inline real sdf_octahedron(struct vec point, const struct placed *s) {
    COUNT(sdf_octahedron, call);
    real x = absolute(point.x), y = absolute(point.y), z = absolute(point.z);
    real zero = set(0.0), radius = set(s->a);
    real m = x + y + z - radius, third = m * set(1.0 / 3.0);
    mask over_yz = less(x, third), over_zx = less(y, third), over_xy = less(z, third);
    real face = m * set(0.57735026918962576451); // 1/√3
    mask edges = either(over_yz, either(over_zx, over_xy));
    if (bits(edges) == 0)
        return face;
    COUNT(sdf_octahedron, edges);
    real a = choose(over_yz, x, choose(over_zx, y, z));
    real b = choose(over_yz, y, choose(over_zx, z, x));
    real c = choose(over_yz, z, choose(over_zx, x, y));
    real k = least_of(most_of(set(0.5) * (c - b + radius), zero), radius);
    real beside = b - radius + k, above = c - k;
    real edge = root(mul_add(a, a, mul_add(beside, beside, above * above)));
    return choose(edges, edge, face);
}

// The map in the form of phase opt2. Lanes that have escaped, or whose ray is done, keep what they
// have (the paper's Fig. 5).
static inline real sdf_mandelbulb(struct vec p, const struct placed *s, mask done) {
    COUNT(sdf_mandelbulb, call);
    real x = p.x, y = p.y, z = p.z, m = vec_dot(p, p), dz = set(1.5);
    mask escaped = done;
    for (int i = 0; i < s->iterations; i++) {
        ACTIVE(LANES - __builtin_popcount((unsigned)bits(escaped)));
        COUNT(sdf_mandelbulb, iteration);
        real x2 = x * x, y2 = y * y, z2 = z * z;
        real k3 = x2 + z2, k4 = k3 - y2;
        real per_k3 = both(set(1.0) / k3, greater(k3, set(1e-300))); // 0 on the axis
        real k1 = mul_add(k3, k3, y2 * neg_mul_add(set(6.0), k3, y2));
        real cos2 = (x2 - z2) * per_k3, sin2 = set(2.0) * (x * z) * per_k3;
        real cos4 = neg_mul_add(sin2 + sin2, sin2, set(1.0)), sin4 = (sin2 + sin2) * cos2;
        real k2 = set(8.0) * y * k4 * k1 * root(k3), k2_sin4 = k2 * (sin4 + sin4);
        x = mul_add(k2_sin4, cos4, p.x);      // p.x + k2·sin8
        z = mul_add(k2_sin4, sin4, p.z - k2); // p.z − k2·cos8
        y = mul_add(k1, k1, neg_mul_add(set(16.0) * y2 * k3, k4 * k4, p.y));
        real slope =
            mul_add(set(8.0) * (m * m * m * root(m)), dz, set(1.0)); // last: its root can wait
        real grown = mul_add(x, x, mul_add(y, y, z * z));
        m = choose(escaped, m, grown);
        dz = choose(escaped, dz, slope);
        escaped = either(escaped, greater(m, set(s->bailout)));
        if (bits(escaped) == (1 << LANES) - 1)
            break;
    }
    ACTIVE(LANES - __builtin_popcount((unsigned)bits(done)));
    real distance = set(0.25) * root(m) / dz * log_of(m); // the division beside the logarithm
    return both(distance, greater(m, set(0.0)));          // √m·ln m → 0 at the centre
}

__attribute__((always_inline)) static inline real
distance_to_shape(struct vec point, const struct placed *placed, mask done) {
    struct vec p = apply_transform(point, placed);
    switch (placed->type) {
    case SHAPE_SPHERE: return sdf_sphere(p, placed);
    case SHAPE_BOX: return sdf_box(p, placed);
    case SHAPE_TORUS: return sdf_torus(p, placed);
    case SHAPE_CONE: return sdf_cone(p, placed);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(p, placed);
    case SHAPE_PLANE: return sdf_plane(p, placed);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(p, placed);
    default: return sdf_mandelbulb(p, placed, done);
    }
}

// Distance to the nearest shape, and which one it is (the first of equals). Lanes of `done` may
// hold anything. Inlined by force: a call passes the three vectors through memory at every step,
// which cost 28 % of scene0's time and 24 % of the Mandelbulb's (n = 180).
__attribute__((always_inline)) static inline real sdf(struct vec p, const struct prepared *scene,
                                                      mask done, real *nearest) {
    COUNT(sdf, call);
    real least = set(INFINITY);
    for (int i = 0; i < scene->model.shape_count; i++) {
        COUNT(sdf, shape);
        real distance = distance_to_shape(p, &scene->placed[i], done);
        mask closer = less(distance, least);
        least = least_of(distance, least); // beside the choice below, not after it
        *nearest = choose(closer, set(scene->placed[i].index), *nearest);
    }
    return least;
}

#endif
