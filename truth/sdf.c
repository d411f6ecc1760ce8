// Signed distances in double-double, the same functions as in every phase. Sphere, box, torus, capped cone, octahedron:
// I. Quilez, "distance functions" (iquilezles.org/articles/distfunctions). Mandelbulb: D. White and P. Nylander's
// power-8 map, I. Quilez, "mandelbulb" (iquilezles.org/articles/mandelbulb). Mandelbox: T. Lowe (fractalforums.com,
// 2010), with the running derivative of Buddhi and Rrrola (fractalforums.com, 2010).
#include "trace.h"

static struct dd sdf_sphere(const struct dd p[3], const struct shape *shape) {
    return dd_sub(dd_norm(p), dd_from(shape->sphere.radius));
}

static struct dd sdf_plane(const struct dd p[3], const struct shape *shape) {
    struct dd sum = dd_from(-shape->plane.offset);
    for (int i = 0; i < 3; i++)
        sum = dd_add(sum, dd_scale(p[i], shape->plane.normal[i]));
    return sum;
}

static struct dd sdf_box(const struct dd p[3], const struct shape *shape) {
    struct dd zero = dd_from(0), outside = zero, most = dd_from(-INFINITY);
    for (int i = 0; i < 3; i++) {
        struct dd q = dd_sub(dd_abs(p[i]), dd_from(shape->box.half_size[i]));
        most = i == 0 ? q : dd_max(most, q);
        if (q.hi > 0)
            outside = dd_add(outside, dd_sqr(q));
    }
    return outside.hi > 0 ? dd_sqrt(outside) : dd_min(most, zero);
}

static struct dd sdf_rounded_box(const struct dd p[3], const struct shape *shape) {
    return dd_sub(sdf_box(p, shape), dd_from(shape->box.rounding));
}

static struct dd length_2(struct dd x, struct dd y) {
    return dd_sqrt(dd_add(dd_sqr(x), dd_sqr(y)));
}

static struct dd sdf_torus(const struct dd p[3], const struct shape *shape) {
    struct dd ring = dd_sub(length_2(p[0], p[2]), dd_from(shape->torus.major_radius));
    return dd_sub(length_2(ring, p[1]), dd_from(shape->torus.minor_radius));
}

static struct dd dd_clamp(struct dd x, struct dd low, struct dd high) {
    return dd_min(dd_max(x, low), high);
}

static struct dd sdf_cone(const struct dd p[3], const struct shape *shape) {
    double r1 = shape->cone.bottom_radius, r2 = shape->cone.top_radius;
    double h = shape->cone.half_height;
    struct dd rho = length_2(p[0], p[2]), zero = dd_from(0), one = dd_from(1);
    struct dd slope = exact_sum(r2, -r1), height = dd_from(2 * h);
    struct dd cap_x = dd_max(zero, dd_sub(rho, dd_from(p[1].hi < 0 ? r1 : r2)));
    struct dd cap_y = dd_sub(dd_abs(p[1]), dd_from(h));
    struct dd from_top_x = dd_sub(dd_from(r2), rho), from_top_y = dd_sub(dd_from(h), p[1]);
    struct dd along = dd_add(dd_mul(from_top_x, slope), dd_mul(from_top_y, height));
    along = dd_div(along, dd_add(dd_sqr(slope), dd_sqr(height)));
    along = dd_clamp(along, zero, one);
    struct dd side_x = dd_sub(dd_mul(slope, along), from_top_x);
    struct dd side_y = dd_sub(dd_mul(height, along), from_top_y);
    struct dd cap = dd_add(dd_sqr(cap_x), dd_sqr(cap_y));
    struct dd side = dd_add(dd_sqr(side_x), dd_sqr(side_y));
    struct dd distance = dd_sqrt(dd_min(cap, side));
    return side_x.hi < 0 && cap_y.hi < 0 ? dd_neg(distance) : distance;
}

static struct dd sdf_octahedron(const struct dd p[3], const struct shape *shape) {
    struct dd a[3], radius = dd_from(shape->octahedron.radius), m = dd_neg(radius);
    for (int i = 0; i < 3; i++) {
        a[i] = dd_abs(p[i]);
        m = dd_add(m, a[i]);
    }
    int first = -1;
    for (int i = 2; i >= 0; i--)
        if (dd_less(dd_scale(a[i], 3), m))
            first = i;
    if (first < 0) // above a face: times 1/√3
        return dd_div(m, dd_sqrt(dd_from(3)));
    struct dd x = a[first], y = a[(first + 1) % 3], z = a[(first + 2) % 3];
    struct dd k = dd_twofold(dd_add(dd_sub(z, y), radius), 0.5);
    k = dd_clamp(k, dd_from(0), radius);
    struct dd q[3] = {x, dd_add(dd_sub(y, radius), k), dd_sub(z, k)};
    return dd_norm(q);
}

// Maps w to w⁸ + p.
static void bulb_map(struct dd w[3], const struct dd p[3]) {
    struct dd x = w[0], y = w[1], z = w[2];
    struct dd x2 = dd_sqr(x), y2 = dd_sqr(y), z2 = dd_sqr(z);
    struct dd x4 = dd_sqr(x2), y4 = dd_sqr(y2), z4 = dd_sqr(z2);
    struct dd k3 = dd_add(x2, z2), k4 = dd_sub(k3, y2);
    struct dd k7 = dd_mul(dd_mul(dd_sqr(k3), k3), dd_sqr(dd_sqr(k3)));
    struct dd k2 = k7.hi > 0 ? dd_div(dd_from(1), dd_sqrt(k7)) : dd_from(0);
    struct dd xz = dd_mul(x2, z2);
    struct dd k1 = dd_add(dd_add(x4, y4), z4);
    k1 = dd_sub(k1, dd_scale(dd_mul(y2, k3), 6));
    k1 = dd_add(k1, dd_twofold(xz, 2));
    struct dd k12 = dd_mul(dd_mul(k1, k2), dd_mul(y, k4));
    struct dd a = dd_mul(dd_mul(x, z), dd_sub(x2, z2));
    a = dd_mul(a, dd_add(dd_sub(x4, dd_scale(xz, 6)), z4));
    w[0] = dd_add(p[0], dd_twofold(dd_mul(a, k12), 64));
    w[1] = dd_sub(dd_sqr(k1), dd_twofold(dd_mul(dd_mul(y2, k3), dd_sqr(k4)), 16));
    w[1] = dd_add(p[1], w[1]);
    struct dd b = dd_add(dd_sqr(x4), dd_sqr(z4));
    b = dd_sub(b, dd_scale(dd_mul(xz, dd_add(x4, z4)), 28));
    b = dd_add(b, dd_scale(dd_mul(x4, z4), 70));
    w[2] = dd_sub(p[2], dd_twofold(dd_mul(b, k12), 8));
}

static struct dd sdf_mandelbulb(const struct dd p[3], const struct shape *shape) {
    struct dd w[3] = {p[0], p[1], p[2]}, m = dd_dot(w, w), dz = dd_from(1.5);
    for (int i = 0; i < shape->mandelbulb.iterations; i++) {
        struct dd m2 = dd_sqr(m), m7 = dd_mul(dd_mul(dd_sqr(m2), m2), m);
        dz = dd_add(dd_mul(dd_twofold(dd_sqrt(m7), 8), dz), dd_from(1));
        bulb_map(w, p);
        m = dd_dot(w, w);
        if (m.hi > shape->mandelbulb.bailout)
            break;
    }
    if (!(m.hi > 0))
        return dd_from(0);
    return dd_div(dd_twofold(dd_mul(dd_log(m), dd_sqrt(m)), 0.25), dz);
}

static struct dd sdf_mandelbox(const struct dd p[3], const struct shape *shape) {
    struct dd limit = dd_from(shape->mandelbox.fold_limit), one = dd_from(1), dr = one;
    struct dd inner_sq =
        exact_product(shape->mandelbox.minimum_radius, shape->mandelbox.minimum_radius);
    struct dd outer_sq =
        exact_product(shape->mandelbox.fixed_radius, shape->mandelbox.fixed_radius);
    struct dd w[3] = {p[0], p[1], p[2]};
    for (int i = 0; i < shape->mandelbox.iterations; i++) {
        for (int k = 0; k < 3; k++)
            w[k] = dd_sub(dd_twofold(dd_clamp(w[k], dd_neg(limit), limit), 2), w[k]);
        struct dd norm_sq = dd_clamp(dd_dot(w, w), inner_sq, outer_sq);
        struct dd factor = dd_scale(dd_div(outer_sq, norm_sq), shape->mandelbox.scale);
        for (int k = 0; k < 3; k++)
            w[k] = dd_add(dd_mul(w[k], factor), p[k]);
        dr = dd_add(dd_mul(dd_abs(factor), dr), one);
    }
    return dd_div(dd_norm(w), dr);
}

void to_frame(const struct solid *solid, const struct dd p[3], struct dd local[3]) {
    const struct shape *shape = solid->shape;
    struct dd moved[3];
    for (int i = 0; i < 3; i++)
        moved[i] = dd_sub(p[i], dd_from(shape->position[i]));
    for (int i = 0; i < 3; i++) {
        local[i] = solid->rotated ? dd_dot(solid->rotation[i], moved) : moved[i];
        if (shape->repeat[i] > 0) {
            struct dd cell = dd_from(shape->repeat[i]);
            struct dd k = dd_floor(dd_add(dd_div(local[i], cell), dd_from(0.5)));
            local[i] = dd_sub(local[i], dd_mul(cell, k));
        }
    }
}

struct dd shape_distance(const struct shape *shape, const struct dd local[3]) {
    switch (shape->type) {
    case SHAPE_SPHERE: return sdf_sphere(local, shape);
    case SHAPE_BOX: return sdf_box(local, shape);
    case SHAPE_TORUS: return sdf_torus(local, shape);
    case SHAPE_CONE: return sdf_cone(local, shape);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(local, shape);
    case SHAPE_PLANE: return sdf_plane(local, shape);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(local, shape);
    case SHAPE_MANDELBOX: return sdf_mandelbox(local, shape);
    default: return sdf_mandelbulb(local, shape);
    }
}
