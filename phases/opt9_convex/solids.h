// Where rays enter solids, in closed form, and the normals there. A box and an octahedron are what 3 and 4
// pairs of parallel planes have in common (T. L. Kay and J. T. Kajiya, "Ray tracing complex scenes", SIGGRAPH
// 1986); sphere and cone are quadratics; the torus alone is marched.
//
// Every ray is first moved along itself to where it is nearest to the shape's position, so that what follows is
// rounded at the size of the shape and not at that of the way to it.
#ifndef OPT9_SOLIDS_H
#define OPT9_SOLIDS_H

#include "torus.h"

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
INLINE void slab(real c, real per, float half, real *in, real *out) {
    real middle = c * per, width = set(half) * absolute(per);
    *in = most_of(*in, set(0.0f) - middle - width);
    *out = least_of(*out, width - middle);
}

INLINE mask enter_box(struct vec c, struct vec per, const struct placed *s, real *t) {
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
INLINE mask enter_rounded_box(struct vec c, struct vec d, struct vec per, const struct placed *s,
                              mask near, real *t, struct vec *away) {
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

INLINE mask enter_octahedron(struct vec c, struct vec d, const struct placed *s, real *t) {
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
INLINE mask enter_cone(struct vec c, struct vec d, const struct placed *s, real *t) {
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
INLINE mask enter_nearby(struct vec c, struct vec d, real before, real half, const struct vec *per,
                         const struct placed *s, mask near, real *in) {
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
// convex solid before their origin, which may be inside. Not for planes.
INLINE mask enter(struct vec o, struct vec d, const struct placed *s, mask active, real *t,
                  struct vec *point, mask *behind) {
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

INLINE struct vec normal_on(struct vec p, const struct placed *s) {
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
