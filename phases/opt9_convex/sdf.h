// Signed distances of as many points at once as there are lanes. Sphere, box, torus, capped cone, octahedron: I. Quilez,
// "distance functions" (iquilezles.org/articles/distfunctions). Mandelbulb: D. White and
// P. Nylander's power-8 map in its trigonometry-free form with the running derivative, I. Quilez,
// "mandelbulb" (iquilezles.org/articles/mandelbulb); it is an estimate, not a bound.
//
// In float, a point at |p| = 20 is known to 1e-6, the scene's hit distance. So nothing is evaluated
// in world coordinates: each ray holds, for each shape, its origin and direction in that shape's
// own frame, and the march evaluates origin + t·direction there, rounded once at the size of the
// shape. Branches that differ between lanes are evaluated for all and chosen by mask.
#ifndef OPT9_SDF_H
#define OPT9_SDF_H

#include "known.h"
#include "vec.h"

// Rays in the frame of one shape. LINEAR: the distance is origin.x + t·direction.x. POWER:
// |p|² − radius² is power + t·(t + slope).
struct approach {
    struct vec origin, direction;
    real power, slope;
};

// With a direction that the kernel may know. What is 0 times it would add no more than a sign to a 0.
static inline real dot_with(const float a[3], struct vec v) {
    if (is_up(a))
        return v.y;
    return vec_dot(vec_set(a), v);
}

// v mirrored at a plane through 0 with unit normal a.
INLINE struct vec reflected_at(const float a[3], struct vec v) {
    if (is_up(a))
        return (struct vec){v.x, set(0.0f) - v.y, v.z};
    return vec_reflect(v, vec_set(a));
}

INLINE struct vec turned(const struct placed *placed, struct vec v) {
    COUNT(turned, call);
    if (!placed->turned)
        return v;
    COUNT(turned, rotation);
    return (struct vec){vec_dot(vec_set(placed->turn[0]), v), vec_dot(vec_set(placed->turn[1]), v),
                        vec_dot(vec_set(placed->turn[2]), v)};
}

// Back from the shape's frame: the matrix is orthogonal, so its transpose.
INLINE struct vec turned_back(const struct placed *placed, struct vec v) {
    COUNT(turned_back, call);
    if (!placed->turned)
        return v;
    COUNT(turned_back, rotation);
    struct vec out = vec_scale(vec_set(placed->turn[0]), v.x);
    out = vec_along(out, vec_set(placed->turn[1]), v.y);
    return vec_along(out, vec_set(placed->turn[2]), v.z);
}

static inline real wrapped(real x, float cell, float per_cell) { // cell 0: not repeated
    return neg_mul_add(set(cell), floor_of(mul_add(x, set(per_cell), set(0.5f))), x);
}

static inline struct vec vec_wrapped(const struct placed *placed, struct vec p) {
    COUNT(vec_wrapped, call);
    return (struct vec){wrapped(p.x, placed->cell[0], placed->per_cell[0]),
                        wrapped(p.y, placed->cell[1], placed->per_cell[1]),
                        wrapped(p.z, placed->cell[2], placed->per_cell[2])};
}

static inline wide wide_wrapped(wide x, double cell, double per_cell) {
    wide turns = wide_floor(wide_less(wide_mul(x, per_cell), -0.5));
    return wide_mul_add(turns, -cell, x);
}

// One coordinate in the shape's frame. It cancels: a place 5 from a turned box has a face's distance
// to 5e-7 by a product of floats, which is the hit distance; and in the 10,000th cell to 4e-3.
static inline real coordinate(const struct placed *placed, struct wide_vec from, int axis) {
    COUNT(coordinate, call);
    wide x = wide_less(wide_dot(from, placed->row[axis]), placed->offset);
    if (placed->repeated) {
        COUNT(coordinate, wrap);
        x = wide_wrapped(x, placed->wide_cell[axis], placed->wide_per_cell[axis]);
    }
    return narrow(x);
}

static inline real power_at(struct wide_vec from, double square) {
    COUNT(power_at, call);
    struct wide_vec p = from;
    half each = half_set(square);
    return narrow((wide){p.x.low * p.x.low + p.y.low * p.y.low + p.z.low * p.z.low - each,
                         p.x.high * p.x.high + p.y.high * p.y.high + p.z.high * p.z.high - each});
}

// Fills one approach per shape: where the rays are, and then where they go.
static inline void approach_origins(struct place origin, const struct prepared *scene,
                                    struct approach *approach) {
    COUNT(approach_origins, call);
    struct wide_vec at = wide_place(origin);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct placed *placed = &scene->placed[i];
        if (placed->way == AT_POINT && !placed->turned && !placed->repeated) {
            approach[i].origin = place_sub(origin, placed->position, scene->more[i].position_lo);
            continue;
        }
        struct wide_vec from = wide_from(at, placed->centre);
        approach[i].origin.x = coordinate(placed, from, 0);
        if (placed->way == LINEAR)
            continue;
        approach[i].origin.y = coordinate(placed, from, 1);
        approach[i].origin.z = coordinate(placed, from, 2);
        if (placed->way == POWER)
            approach[i].power = power_at(from, scene->more[i].radius_sq);
    }
}

static inline void approach_directions(struct vec direction, const struct prepared *scene,
                                       struct approach *approach) {
    COUNT(approach_directions, call);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct placed *placed = &scene->placed[i];
        if (placed->way == LINEAR) {
            COUNT(approach_directions, linear);
            approach[i].direction.x = vec_dot(vec_set(placed->normal), direction);
            continue;
        }
        approach[i].direction = turned(placed, direction);
        if (placed->way == POWER) {
            COUNT(approach_directions, power);
            approach[i].slope = set(2.0f) * vec_dot(approach[i].origin, approach[i].direction);
        }
    }
}

// The origins moved by a little along the rays.
static inline void approach_moved(real by, const struct prepared *scene,
                                  struct approach *approach) {
    COUNT(approach_moved, call);
    for (int i = 0; i < scene->model.shape_count; i++) {
        struct approach *a = &approach[i];
        COUNT(approach_moved, first);
        a->origin.x = mul_add(a->direction.x, by, a->origin.x);
        if (scene->placed[i].way == LINEAR)
            continue;
        COUNT(approach_moved, others);
        a->origin.y = mul_add(a->direction.y, by, a->origin.y);
        a->origin.z = mul_add(a->direction.z, by, a->origin.z);
        if (scene->placed[i].way == POWER) {
            COUNT(approach_moved, power);
            a->power = mul_add(by, by + a->slope, a->power);
        }
    }
}

static inline real sdf_sphere(struct vec p, const struct placed *s) {
    COUNT(sdf_sphere, call);
    return vec_norm(p) - set(s->a);
}

// |p| − a from |p|² − a². The difference of two numbers of a planet's size would be lost.
static inline real sdf_power(real power, const struct placed *s) {
    COUNT(sdf_power, call);
    return power / (root(most_of(power + set(s->b), set(0.0f))) + set(s->a));
}

static inline real sdf_plane(struct vec p, const struct placed *s) {
    COUNT(sdf_plane, call);
    return vec_dot(p, vec_set(s->size)) - set(s->a);
}

static inline real sdf_box(struct vec p, const struct placed *s) {
    COUNT(sdf_box, call);
    real zero = set(0.0f);
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
    real zero = set(0.0f), one = set(1.0f);
    real radius = root(mul_add(p.x, p.x, p.z * p.z));
    real x = radius - set(s->b), y = p.y - set(s->c); // from the top rim
    real rim = choose(less(p.y, zero), set(s->a), set(s->b));
    real cap_x = most_of(radius - rim, zero), cap_y = absolute(p.y) - set(s->c);
    real across = mul_add(x, set(s->slope[0]), y * set(s->slope[1]));
    real along = least_of(most_of(across * set(-s->per_slope_sq), zero), one);
    real side_x = mul_add(set(s->slope[0]), along, x);
    real side_y = mul_add(set(s->slope[1]), along, y);
    mask inside = both(negative(side_x), negative(cap_y));
    real square =
        least_of(mul_add(cap_x, cap_x, cap_y * cap_y), mul_add(side_x, side_x, side_y * side_y));
    return negate_where(inside, root(square));
}

static inline real sdf_octahedron(struct vec point, const struct placed *s) {
    COUNT(sdf_octahedron, call);
    real x = absolute(point.x), y = absolute(point.y), z = absolute(point.z);
    real zero = set(0.0f), radius = set(s->a);
    real m = x + y + z - radius, third = m * set(1.0f / 3.0f);
    mask over_yz = less(x, third), over_zx = less(y, third), over_xy = less(z, third);
    real face = m * set(0.57735026918962576451f); // 1/√3
    mask edges = either(over_yz, either(over_zx, over_xy));
    if (!any(edges))
        return face;
    COUNT(sdf_octahedron, edges);
    real a = choose(over_yz, x, choose(over_zx, y, z));
    real b = choose(over_yz, y, choose(over_zx, z, x));
    real c = choose(over_yz, z, choose(over_zx, x, y));
    real k = least_of(most_of(set(0.5f) * (c - b + radius), zero), radius);
    real beside = b - radius + k, above = c - k;
    real edge = root(mul_add(a, a, mul_add(beside, beside, above * above)));
    return choose(edges, edge, face);
}

// The map in the form of phase opt2. Lanes that have escaped, or whose ray is done, keep what they
// have (the paper's Fig. 5).
static inline real sdf_mandelbulb(struct vec p, const struct placed *s, mask done) {
    COUNT(sdf_mandelbulb, call);
    real x = p.x, y = p.y, z = p.z, m = vec_dot(p, p), dz = set(1.5f);
    // |w|² becomes |p|^16, which overflows from |p| = 256 on; from 32 on the estimate is r·ln(r)/3
    // to a float's precision, after the one iteration that escapes.
    mask far = greater(m, set(1024.0f)), escaped = either(done, far);
    for (int i = 0; i < s->iterations; i++) {
        ACTIVE(LANES - count_of(escaped));
        COUNT(sdf_mandelbulb, iteration);
        real x2 = x * x, y2 = y * y, z2 = z * z;
        real k3 = x2 + z2, k4 = k3 - y2;
        real per_k3 = keep(greater(k3, set(1e-36f)), set(1.0f) / k3); // 0 on the axis
        real k1 = mul_add(k3, k3, y2 * neg_mul_add(set(6.0f), k3, y2));
        real cos2 = (x2 - z2) * per_k3, sin2 = set(2.0f) * (x * z) * per_k3;
        real cos4 = neg_mul_add(sin2 + sin2, sin2, set(1.0f)), sin4 = (sin2 + sin2) * cos2;
        real k2 = set(8.0f) * y * k4 * k1 * root(k3), k2_sin4 = k2 * (sin4 + sin4);
        x = mul_add(k2_sin4, cos4, p.x);      // p.x + k2·sin8
        z = mul_add(k2_sin4, sin4, p.z - k2); // p.z − k2·cos8
        y = mul_add(k1, k1, neg_mul_add(set(16.0f) * y2 * k3, k4 * k4, p.y));
        real slope =
            mul_add(set(8.0f) * (m * m * m * root(m)), dz, set(1.0f)); // last: its root can wait
        real grown = mul_add(x, x, mul_add(y, y, z * z));
        m = choose(escaped, m, grown);
        dz = choose(escaped, dz, slope);
        escaped = either(escaped, greater(m, set(s->bailout)));
        if (all(escaped))
            break;
    }
    ACTIVE(LANES - count_of(either(done, far)));
    COUNT(sdf_mandelbulb, estimate);
    real distance = set(0.25f) * root(m) / dz * log_of(m); // the division beside the logarithm
    if (any(far)) {
        ACTIVE(count_of(but_not(done, far)));
        COUNT(sdf_mandelbulb, far);
        real r = root(vec_dot(p, p));
        distance = choose(far, r * log_of(r) * set(1.0f / 3.0f), distance);
    }
    ACTIVE(LANES - count_of(done));
    return keep(greater(m, set(0.0f)), distance); // √m·ln m → 0 at the centre
}

// At a point of the shape's own frame, wrapped if it is repeated.
__attribute__((always_inline)) static inline real
distance_at(struct vec p, const struct placed *placed, mask done) {
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

// Distance to one shape at distance t along the rays.
__attribute__((always_inline)) static inline real
distance_to_shape(const struct approach *a, real t, const struct placed *placed, mask done) {
    COUNT(distance_to_shape, call);
    if (placed->way != AT_POINT) {
        if (placed->way == POWER) {
            COUNT(distance_to_shape, power);
            return sdf_power(mul_add(t, t + a->slope, a->power), placed);
        }
        COUNT(distance_to_shape, linear);
        return mul_add(t, a->direction.x, a->origin.x);
    }
    COUNT(distance_to_shape, point);
    struct vec p = vec_along(a->origin, a->direction, t);
    if (placed->repeated)
        p = vec_wrapped(placed, p);
    return distance_at(p, placed, done);
}

// Distance to the nearest shape, and if asked which one it is (the first of equals). Lanes of `done`
// may hold anything. Inlined by force: the march keeps its state in registers.
__attribute__((always_inline)) static inline real sdf(const struct approach *approach, real t,
                                                      const struct prepared *scene, mask done,
                                                      real *nearest) {
    COUNT(sdf, call);
    real least = set(INFINITY);
    for (int i = 0; i < scene->model.shape_count; i++) {
        COUNT(sdf, shape);
        real distance = distance_to_shape(&approach[i], t, &scene->placed[i], done);
        if (nearest) { // known where it is inlined
            COUNT(sdf, which);
            *nearest = choose(less(distance, least), set(scene->placed[i].index), *nearest);
        }
        least = least_of(distance, least);
    }
    return least;
}

#endif
