// Where rays enter solids, in closed form, and the normals there. A box and an octahedron are what 3 and 4
// pairs of parallel planes have in common (T. L. Kay and J. T. Kajiya, "Ray tracing complex scenes", SIGGRAPH
// 1986); sphere and cone are quadratics; the torus alone is marched.
//
// Every ray is first moved along itself to where it is nearest to the shape's position, so that what follows is
// rounded at the size of the shape and not at that of the way to it.
#ifndef OPT9_SOLIDS_H
#define OPT9_SOLIDS_H

#include "sdf.h"

static inline real inverse_of(real d) { // of a direction's part: 0 becomes 1e-20
    return set(1.0f) / with_sign_of(d, most_of(absolute(d), set(1e-20f)));
}

// All three by one quotient, as far as floats of a direction go.
static inline struct vec inverses_of(struct vec d) {
    COUNT(inverses_of, call);
    real least = set(1e-12f);
    real x = with_sign_of(d.x, most_of(absolute(d.x), least));
    real y = with_sign_of(d.y, most_of(absolute(d.y), least));
    real z = with_sign_of(d.z, most_of(absolute(d.z), least));
    real yz = y * z, per = set(1.0f) / (x * yz), of_x = per * x;
    return (struct vec){per * yz, of_x * z, of_x * y};
}

// What is between two planes at distance `half` from the origin, of rays that are at c and go 1/per. Be they so near that
// rounding makes both the same: in is no more than out.
static inline void slab(real c, real per, float half, real *in, real *out) {
    real middle = c * per, width = set(half) * absolute(per);
    *in = most_of(*in, set(0.0f) - middle - width);
    *out = least_of(*out, width - middle);
}

static inline mask enter_box(struct vec c, struct vec per, const struct placed *s, real *t) {
    COUNT(enter_box, call);
    real out = set(INFINITY);
    *t = set(-INFINITY);
    slab(c.x, per.x, s->size[0], t, &out);
    slab(c.y, per.y, s->size[1], t, &out);
    slab(c.z, per.z, s->size[2], t, &out);
    return not_less(out, *t);
}

// From where the ray enters the box that the rounding cuts the edges off, Newton's steps on the square of the distance to
// the smaller box less that of the rounding: it is convex along a ray, so that none goes too far, and a ray that comes no
// nearer has missed. A flat part is there at once. away (NULL: not asked for): where they enter, from the smaller box.
static inline mask enter_rounded_box(struct vec c, struct vec d, struct vec per,
                                     const struct placed *s, mask near, real *t, struct vec *away) {
    COUNT(enter_rounded_box, call);
    COUNT(enter_rounded_box, scalar);
    real zero = set(0.0f), out = set(INFINITY), at = set(-INFINITY);
    float close = 0x1p-22f * s->bound, within = (s->a + close) * (s->a + close);
    slab(c.x, per.x, s->size[0] + s->a, &at, &out);
    slab(c.y, per.y, s->size[1] + s->a, &at, &out);
    slab(c.z, per.z, s->size[2] + s->a, &at, &out);
    mask going = both(near, not_less(out, at)), found = no_lane();
    struct vec p = c;
    real x = zero, y = zero, z = zero;
    for (int step = 0; step < 64 && any(going); step++) {
        ACTIVE(count_of(going));
        COUNT(enter_rounded_box, step);
        p = vec_along(c, d, at);
        x = most_of(absolute(p.x) - set(s->size[0]), zero);
        y = most_of(absolute(p.y) - set(s->size[1]), zero);
        z = most_of(absolute(p.z) - set(s->size[2]), zero);
        real square = vec_dot((struct vec){x, y, z}, (struct vec){x, y, z});
        mask reached = both(going, not_less(set(within), square));
        found = either(found, reached);
        going = but_not(reached, going);
        if (!any(going))
            break;
        ACTIVE(count_of(going));
        COUNT(enter_rounded_box, on);
        real rate = mul_add(
            x, negate_where(negative(p.x), d.x), // of half the square
            mul_add(y, negate_where(negative(p.y), d.y), z * negate_where(negative(p.z), d.z)));
        going = but_not(either(not_less(rate, zero), greater(at, out)), going);
        at = choose(
            going, at - set(0.5f) * (square - set(s->a * s->a)) / least_of(rate, set(-1e-30f)), at);
    }
    if (away) {
        ACTIVE(count_of(near));
        COUNT(enter_rounded_box, away);
        *away = (struct vec){with_sign_of(p.x, x), with_sign_of(p.y, y), with_sign_of(p.z, z)};
    }
    *t = at;
    return found;
}

static inline mask enter_octahedron(struct vec c, struct vec d, const struct placed *s, real *t) {
    COUNT(enter_octahedron, call);
    real out = set(INFINITY), sum = c.x + c.y, apart = c.x - c.y, d_sum = d.x + d.y,
         d_apart = d.x - d.y;
    *t = set(-INFINITY);
    slab(sum + c.z, inverse_of(d_sum + d.z), s->a, t, &out);
    slab(sum - c.z, inverse_of(d_sum - d.z), s->a, t, &out);
    slab(apart + c.z, inverse_of(d_apart + d.z), s->a, t, &out);
    slab(apart - c.z, inverse_of(d_apart - d.z), s->a, t, &out);
    return not_less(out, *t);
}

#define OBLATE 16.0f // a cone this much wider than high

// Between the caps the cone is where x² + z² − (m + k·y)² ≤ 0, which is A·t² + 2·B·t + C along a ray; it is
// convex there, so a ray enters it once: through the cap, or at the root where that falls.
static inline mask enter_cone(struct vec c, struct vec d, const struct placed *s, real *t) {
    COUNT(enter_cone, call);
    COUNT(enter_cone, scalar);
    real in = set(-INFINITY), out = set(INFINITY), zero = set(0.0f), ahead = zero;
    bool oblate = fabsf(s->slope[0]) > OBLATE * s->slope[1];
    if (oblate) {
        COUNT(enter_cone, oblate);
        COUNT(enter_cone, margin);
        // A·t² and C are slope² times what remains of them: from where the ray is between the caps they are small.
        ahead = least_of(most_of((zero - c.y) * inverse_of(d.y), set(-s->bound)), set(s->bound));
        c = vec_along(c, d, ahead);
    }
    slab(c.y, inverse_of(d.y), s->c, &in, &out);
    real k = set(s->slope[0] / s->slope[1]), wide = mul_add(k, c.y, set(0.5f * (s->a + s->b)));
    real dk = k * d.y;
    real a = mul_add(d.x, d.x, mul_sub(d.z, d.z, dk * dk));
    real b = mul_add(c.x, d.x, mul_sub(c.z, d.z, wide * dk));
    real cc = mul_add(c.x, c.x, mul_sub(c.z, c.z, wide * wide));
    real square = mul_sub(b, b, a * cc);
    real r = root(most_of(square, zero));
    mask towards = less(b, zero); // which of two forms does not cancel
    real side = choose(towards, cc, zero - b - r) / choose(towards, r - b, a);
    // At the cap: is it within the rim?
    mask cap = not_less(zero, mul_add(in, mul_add(in, a, b + b), cc));
    *t = choose(cap, in, side);
    mask met =
        both(not_less(out, in),
             either(cap, both(both(not_less(square, zero), not_less(side, in)), less(side, out))));
    if (oblate) {
        *t = *t + ahead;
        // Still above it or below it: so far off is what its quadratic may no longer tell.
        met = both(met, not_less(set(s->c + 1e-6f * s->bound), absolute(c.y)));
    }
    return met;
}

// Sphere tracing, helped by what is convex: the distance to the disc that fills the ring, less the tube's
// radius, is a convex function along a ray, and nowhere larger than the torus's. So Newton's step on it never
// goes too far, and a ray that no longer comes nearer to it has missed. Of the torus's own distance h no more than 1/radius
// bends down along a ray: a parabola of 4/3 of that says how far no surface can be, as long as the radius falls by less
// than a quarter, and where h is small it is Newton's step. Steps of h alone were more than 256 where a ray follows the
// ring's inner side, and it was lost.
static inline mask enter_torus(struct vec c, struct vec d, const struct placed *s, mask near,
                               real *t) {
    COUNT(enter_torus, call);
    COUNT(enter_torus, scalar);
    real zero = set(0.0f), bound = set(s->bound), tiny = set(1e-30f);
    // Not before it is between two planes and in the cylinder about the ring; 2^-10 wider, for what is rounded.
    float wide = 1 + 0x1p-10f, outer_sq = wide * wide * s->bound_sq;
    real per = set(1.0f) / (with_sign_of(d.y, most_of(absolute(d.y), set(1e-12f))));
    real width = set(wide * s->b) * absolute(per), middle = c.y * per;
    real square = most_of(mul_add(d.x, d.x, d.z * d.z), set(1e-12f));
    real lean = mul_add(c.x, d.x, c.z * d.z), far = mul_add(c.x, c.x, c.z * c.z);
    real inside = neg_mul_add(square, far - set(outer_sq), lean * lean);
    real half = root(most_of(inside, zero)), per_square = set(1.0f) / square;
    real at = most_of(most_of(*t, zero - middle - width), (zero - lean - half) * per_square);
    real out = least_of(width - middle, (half - lean) * per_square);
    near = both(near, both(not_less(inside, zero), not_less(out, at)));
    mask going = near, found = no_lane();
    if (!any(going))
        return going;
    for (int step = 0; step < 256; step++) {
        ACTIVE(count_of(going));
        COUNT(enter_torus, step);
        struct vec p = vec_along(c, d, at);
        real radius = root(mul_add(p.x, p.x, p.z * p.z)), ring = radius - set(s->a);
        real tube = root(mul_add(ring, ring, p.y * p.y));
        mask outer = greater(ring, zero);
        real h = tube - set(s->b);
        real hull = choose(outer, h, absolute(p.y) - set(s->b));
        real per_radius = set(1.0f) / most_of(radius, tiny);
        real rate = mul_add(p.x, d.x, p.z * d.z) * per_radius;            // of the radius
        real fall = mul_add(ring, rate, p.y * d.y) / most_of(tube, tiny); // of the torus's distance
        real hull_fall = choose(outer, fall, negate_where(negative(p.y), d.y));
        mask reached = both(going, less(absolute(h), set(s->c))), outside = greater(h, zero);
        real bent = root(most_of(mul_add(fall, fall, h * set(8.0f / 3.0f) * per_radius), zero));
        // From inside Newton's step back.
        real below =
            choose(outside, most_of(bent - fall, set(1e-6f)), most_of(zero - fall, set(0.05f)));
        real newton = choose(outside, h + h, h) / below;
        real safe = most_of(h, least_of(newton, radius * set(0.25f)));
        real hull_step = zero - hull / least_of(hull_fall, set(-1e-6f));
        real ahead = choose(greater(hull, zero), most_of(safe, hull_step), safe);
        mask back = but_not(outside, less(fall, zero));
        at = choose(going, at + choose(back, newton, choose(outside, ahead, h)), at);
        found = either(found, reached);
        mask gone =
            either(both(greater(hull, zero), not_less(hull_fall, zero)), greater(at, bound));
        going = but_not(either(reached, gone), going);
        if (!any(going))
            break;
    }
    *t = at;
    return found;
}

static inline struct vec known_inverses(struct vec d, const struct vec *known) {
    COUNT(known_inverses, call);
    if (known)
        return *known;
    COUNT(known_inverses, unknown);
    return (struct vec){inverse_of(d.x), inverse_of(d.y), inverse_of(d.z)};
}

// Rays that go d, 1/per in parts (of boxes alone; NULL: not known), and are nearest to the shape's position at c, `before` from
// their origin, within the bounding sphere where `near`; half: how long, half of it (spheres and tori alone). Those that
// enter it: how far from there. Not for planes.
static inline mask enter_nearby(struct vec c, struct vec d, real before, real half,
                                const struct vec *per, const struct placed *s, mask near,
                                real *in) {
    COUNT(enter_nearby, call);
    switch (s->type) {
    case SHAPE_SPHERE:
        COUNT(enter_nearby, sphere);
        *in = set(0.0f) - half;
        return near;
    case SHAPE_BOX: return both(near, enter_box(c, known_inverses(d, per), s, in));
    case SHAPE_ROUNDED_BOX:
        return both(near, enter_rounded_box(c, d, known_inverses(d, per), s, near, in, NULL));
    case SHAPE_CONE: return both(near, enter_cone(c, d, s, in));
    case SHAPE_OCTAHEDRON: return both(near, enter_octahedron(c, d, s, in));
    default:
        COUNT(enter_nearby, torus);
        *in = most_of(set(0.0f) - half, set(0.0f) - before);
        return both(near, enter_torus(c, d, s, near, in));
    }
}

// Rays with origin `o` and direction `d` in the shape's frame. Where they enter it ahead of their origin:
// how far, and the point there, on the surface to the rounding of its own size. `behind`: those that entered a
// convex solid before their origin, which may be inside. Not for planes. Called, it costs spheres40 a fifth more
// instructions, and gcc 12 calls it since cones much wider than high have a way of their own.
__attribute__((always_inline)) static inline mask enter(struct vec o, struct vec d,
                                                        const struct placed *s, mask active,
                                                        real *t, struct vec *point, mask *behind) {
    ACTIVE(count_of(active));
    COUNT(enter, call);
    real before = set(0.0f) - vec_dot(o, d);
    struct vec c = vec_along(o, d, before);
    real square = vec_dot(c, c);
    mask near = both(active, less(square, set(s->bound_sq)));
    *t = set(INFINITY);
    *point = c;
    *behind = no_lane();
    if (!any(near))
        return near;
    ACTIVE(count_of(near));
    COUNT(enter, near);
    real in, half = root(most_of(set(s->bound_sq) - square, set(0.0f)));
    near = both(near, greater(before + half, set(0.0f)));
    near = enter_nearby(c, d, before, half, NULL, s, near, &in);
    *t = before + in;
    *point = vec_along(c, d, in);
    mask ahead = greater(*t, set(0.0f));
    *behind = but_not(ahead, near);
    return both(near, ahead);
}

// Of a larger rounding, by its share of the bounding sphere, a point on the surface knows its radius to 1e-3, of which one
// of Newton's steps leaves 1e-6: no root, no quotient.
#define ROUND 0x1p-10f

// Outward, of unit length, in the shape's frame, at points on its surface.
// 1/length by a step of Newton's from `per`, near to it: of what float misses a solid by, far from the origin, a normal
// is not to be longer or shorter.
static inline real per_length(real square, float per) {
    return set(per) * neg_mul_add(square * set(0.5f), set(per * per), set(1.5f));
}

static inline struct vec normal_on(struct vec p, const struct placed *s) {
    COUNT(normal_on, call);
    real one = set(1.0f);
    switch (s->type) {
    case SHAPE_SPHERE:
        COUNT(normal_on, sphere);
        COUNT(normal_on, sphere_scalar);
        return vec_scale(p, per_length(vec_dot(p, p), 1.0f / s->a));
    case SHAPE_BOX: {
        COUNT(normal_on, box);
        real x = absolute(p.x) - set(s->size[0]), y = absolute(p.y) - set(s->size[1]);
        real z = absolute(p.z) - set(s->size[2]);
        mask on_x = both(not_less(x, y), not_less(x, z)), on_y = but_not(on_x, not_less(y, z));
        return (struct vec){with_sign_of(p.x, keep(on_x, one)), with_sign_of(p.y, keep(on_y, one)),
                            with_sign_of(p.z, drop(either(on_x, on_y), one))};
    }
    case SHAPE_ROUNDED_BOX: {
        COUNT(normal_on, rounded);
        real x = absolute(p.x) - set(s->size[0]), y = absolute(p.y) - set(s->size[1]);
        real z = absolute(p.z) - set(s->size[2]), most = most_of(x, most_of(y, z));
        // Where float does not see the rounding it is a box.
        mask sharp = not_less(set(0.0f), most), on_x = not_less(x, most), on_y = not_less(y, most);
        struct vec away = {most_of(x, set(0.0f)), most_of(y, set(0.0f)), most_of(z, set(0.0f))};
        struct vec face = {keep(on_x, one), keep(but_not(on_x, on_y), one),
                           drop(either(on_x, on_y), one)};
        real per;
        if (s->a > ROUND * s->bound) {
            COUNT(normal_on, round);
            COUNT(normal_on, round_scalar);
            per = per_length(vec_dot(away, away), 1.0f / s->a);
        } else {
            COUNT(normal_on, square);
            per = one / vec_norm(away);
        }
        away = vec_choose(sharp, face, vec_scale(away, per));
        return (struct vec){with_sign_of(p.x, away.x), with_sign_of(p.y, away.y),
                            with_sign_of(p.z, away.z)};
    }
    case SHAPE_CONE: {
        COUNT(normal_on, cone);
        COUNT(normal_on, cone_scalar);
        real radius = root(mul_add(p.x, p.x, p.z * p.z)), k = set(s->slope[0] / s->slope[1]);
        real side = radius - mul_add(k, p.y, set(0.5f * (s->a + s->b)));
        float per = 1.0f / sqrtf(1.0f + s->slope[0] * s->slope[0] / (s->slope[1] * s->slope[1]));
        mask cap = greater(absolute(p.y) - set(s->c), side * set(per));
        real out = set(per) / most_of(radius, set(1e-30f));
        return (struct vec){drop(cap, p.x * out),
                            choose(cap, with_sign_of(p.y, one), k * set(-per)),
                            drop(cap, p.z * out)};
    }
    case SHAPE_OCTAHEDRON: {
        real part = set(0.57735026918962576451f);
        return (struct vec){with_sign_of(p.x, part), with_sign_of(p.y, part),
                            with_sign_of(p.z, part)};
    }
    default: {
        COUNT(normal_on, torus);
        real radius = root(mul_add(p.x, p.x, p.z * p.z));
        real outward = one - set(s->a) / most_of(radius, set(1e-30f));
        struct vec n = {p.x * outward, p.y, p.z * outward};
        return vec_scale(n, one / most_of(vec_norm(n), set(1e-30f)));
    }
    }
}

#endif
