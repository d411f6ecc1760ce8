// Where rays enter solids, in closed form, and the normals there. A box and an octahedron are what 3 and 4
// pairs of parallel planes have in common (T. L. Kay and J. T. Kajiya, "Ray tracing complex scenes", SIGGRAPH
// 1986); sphere and cone are quadratics; the torus alone is marched.
//
// Every ray is first moved along itself to where it is nearest to the shape's position, so that what follows is
// rounded at the size of the shape and not at that of the way to it.
#ifndef OPT9_SOLIDS_H
#define OPT9_SOLIDS_H

#include "hit/torus.h"

static inline vfloat inverse_of(vfloat d) { // of a direction's part: 0 becomes 1e-20
    return v_splat(1.0f) / v_copysign(v_max(v_abs(d), v_splat(1e-20f)), d);
}

// All three by one quotient, as far as floats of a direction go.
static inline struct vec inverses_of(struct vec d) {
    COUNT(inverses_of, call);
    vfloat least = v_splat(1e-12f);
    vfloat x = v_copysign(v_max(v_abs(d.x), least), d.x);
    vfloat y = v_copysign(v_max(v_abs(d.y), least), d.y);
    vfloat z = v_copysign(v_max(v_abs(d.z), least), d.z);
    vfloat yz = y * z, per = v_splat(1.0f) / (x * yz), of_x = per * x;
    return (struct vec){per * yz, of_x * z, of_x * y};
}

// What is between two planes at distance `half` from the origin, of rays that are at c and go 1/per. Be they so near that
// rounding makes both the same: in is no more than out.
INLINE void slab(vfloat c, vfloat per, float half, vfloat *in, vfloat *out) {
    vfloat middle = c * per, width = v_splat(half) * v_abs(per);
    *in = v_max(*in, v_splat(0.0f) - middle - width);
    *out = v_min(*out, width - middle);
}

INLINE vmask enter_box(struct vec c, struct vec per, const struct primitive *s, vfloat *t) {
    COUNT(enter_box, call);
    vfloat out = v_splat(INFINITY);
    *t = v_splat(-INFINITY);
    slab(c.x, per.x, s->size[0], t, &out);
    slab(c.y, per.y, s->size[1], t, &out);
    slab(c.z, per.z, s->size[2], t, &out);
    return v_cmp_ge(out, *t);
}

// From where the ray enters the box that the rounding cuts the edges off, Newton's steps on the square of the distance to
// the smaller box less that of the rounding: it is convex along a ray, so that none goes too far, and a ray that comes no
// nearer has missed. A flat part is there at once. away (NULL: not asked for): where they enter, from the smaller box.
INLINE vmask enter_rounded_box(struct vec c, struct vec d, struct vec per,
                               const struct primitive *s, vmask near, vfloat *t, struct vec *away) {
    COUNT(enter_rounded_box, call);
    COUNT(enter_rounded_box, scalar);
    vfloat zero = v_splat(0.0f), out = v_splat(INFINITY), at = v_splat(-INFINITY);
    float close = 0x1p-22f * s->bound, within = (s->a + close) * (s->a + close);
    slab(c.x, per.x, s->size[0] + s->a, &at, &out);
    slab(c.y, per.y, s->size[1] + s->a, &at, &out);
    slab(c.z, per.z, s->size[2] + s->a, &at, &out);
    vmask going = v_and(near, v_cmp_ge(out, at)), found = v_mask_none();
    struct vec p = c;
    vfloat x = zero, y = zero, z = zero;
    for (int step = 0; step < 64 && v_any(going); step++) {
        ACTIVE(v_count(going));
        COUNT(enter_rounded_box, step);
        p = vec_along(c, d, at);
        x = v_max(v_abs(p.x) - v_splat(s->size[0]), zero);
        y = v_max(v_abs(p.y) - v_splat(s->size[1]), zero);
        z = v_max(v_abs(p.z) - v_splat(s->size[2]), zero);
        vfloat square = vec_dot((struct vec){x, y, z}, (struct vec){x, y, z});
        vmask reached = v_and(going, v_cmp_ge(v_splat(within), square));
        found = v_or(found, reached);
        going = v_andnot(reached, going);
        if (!v_any(going))
            break;
        ACTIVE(v_count(going));
        COUNT(enter_rounded_box, on);
        vfloat rate = v_madd(x, v_negate_where(v_signbit(p.x), d.x), // of half the square
                             v_madd(y, v_negate_where(v_signbit(p.y), d.y),
                                    z * v_negate_where(v_signbit(p.z), d.z)));
        going = v_andnot(v_or(v_cmp_ge(rate, zero), v_cmp_gt(at, out)), going);
        at = v_select(going,
                      at - v_splat(0.5f) * (square - v_splat(s->a * s->a)) /
                               v_min(rate, v_splat(-1e-30f)),
                      at);
    }
    if (away) {
        ACTIVE(v_count(near));
        COUNT(enter_rounded_box, away);
        *away = (struct vec){v_copysign(x, p.x), v_copysign(y, p.y), v_copysign(z, p.z)};
    }
    *t = at;
    return found;
}

INLINE vmask enter_octahedron(struct vec c, struct vec d, const struct primitive *s, vfloat *t) {
    COUNT(enter_octahedron, call);
    vfloat out = v_splat(INFINITY), sum = c.x + c.y, apart = c.x - c.y, d_sum = d.x + d.y,
           d_apart = d.x - d.y;
    *t = v_splat(-INFINITY);
    slab(sum + c.z, inverse_of(d_sum + d.z), s->a, t, &out);
    slab(sum - c.z, inverse_of(d_sum - d.z), s->a, t, &out);
    slab(apart + c.z, inverse_of(d_apart + d.z), s->a, t, &out);
    slab(apart - c.z, inverse_of(d_apart - d.z), s->a, t, &out);
    return v_cmp_ge(out, *t);
}

#define CONE_OBLATE 16.0f // a cone this much wider than high

// Between the caps the cone is where x² + z² − (m + k·y)² ≤ 0, which is A·t² + 2·B·t + C along a ray; it is
// convex there, so a ray enters it once: through the cap, or at the root where that falls.
INLINE vmask enter_cone(struct vec c, struct vec d, const struct primitive *s, vfloat *t) {
    COUNT(enter_cone, call);
    COUNT(enter_cone, scalar);
    vfloat in = v_splat(-INFINITY), out = v_splat(INFINITY), zero = v_splat(0.0f), ahead = zero;
    bool oblate = fabsf(s->slope[0]) > CONE_OBLATE * s->slope[1];
    if (oblate) {
        COUNT(enter_cone, oblate);
        COUNT(enter_cone, margin);
        // A·t² and C are slope² times what remains of them: from where the ray is between the caps they are small.
        ahead = v_min(v_max((zero - c.y) * inverse_of(d.y), v_splat(-s->bound)), v_splat(s->bound));
        c = vec_along(c, d, ahead);
    }
    slab(c.y, inverse_of(d.y), s->c, &in, &out);
    vfloat k = v_splat(s->slope[0] / s->slope[1]),
           wide = v_madd(k, c.y, v_splat(0.5f * (s->a + s->b)));
    vfloat dk = k * d.y;
    vfloat a = v_madd(d.x, d.x, v_msub(d.z, d.z, dk * dk));
    vfloat b = v_madd(c.x, d.x, v_msub(c.z, d.z, wide * dk));
    vfloat cc = v_madd(c.x, c.x, v_msub(c.z, c.z, wide * wide));
    vfloat square = v_msub(b, b, a * cc);
    vfloat r = v_sqrt(v_max(square, zero));
    vmask towards = v_cmp_lt(b, zero); // which of two forms does not cancel
    vfloat side = v_select(towards, cc, zero - b - r) / v_select(towards, r - b, a);
    // At the cap: is it within the rim?
    vmask cap = v_cmp_ge(zero, v_madd(in, v_madd(in, a, b + b), cc));
    *t = v_select(cap, in, side);
    vmask met = v_and(
        v_cmp_ge(out, in),
        v_or(cap, v_and(v_and(v_cmp_ge(square, zero), v_cmp_ge(side, in)), v_cmp_lt(side, out))));
    if (oblate) {
        *t = *t + ahead;
        // Still above it or below it: so far off is what its quadratic may no longer tell.
        met = v_and(met, v_cmp_ge(v_splat(s->c + 1e-6f * s->bound), v_abs(c.y)));
    }
    return met;
}

static inline struct vec shared_inverses(struct vec d, const struct vec *known) {
    COUNT(shared_inverses, call);
    if (known)
        return *known;
    COUNT(shared_inverses, unknown);
    return (struct vec){inverse_of(d.x), inverse_of(d.y), inverse_of(d.z)};
}

// Rays that go d, 1/per in parts (of boxes alone; NULL: not known), and are nearest to the shape's position at c, `before` from
// their origin, within the bounding sphere where `shadow_candidate`; half: how long, half of it (spheres and tori alone). Those that
// enter it: how far from there. Not for planes.
INLINE vmask enter_nearby(struct vec c, struct vec d, vfloat before, vfloat half,
                          const struct vec *per, const struct primitive *s, vmask near,
                          vfloat *in) {
    COUNT(enter_nearby, call);
    switch (s->type) {
    case SHAPE_SPHERE:
        COUNT(enter_nearby, sphere);
        *in = v_splat(0.0f) - half;
        return near;
    case SHAPE_BOX: return v_and(near, enter_box(c, shared_inverses(d, per), s, in));
    case SHAPE_ROUNDED_BOX:
        return v_and(near, enter_rounded_box(c, d, shared_inverses(d, per), s, near, in, NULL));
    case SHAPE_CONE: return v_and(near, enter_cone(c, d, s, in));
    case SHAPE_OCTAHEDRON: return v_and(near, enter_octahedron(c, d, s, in));
    default:
        COUNT(enter_nearby, torus);
        *in = v_max(v_splat(0.0f) - half, v_splat(0.0f) - before);
        return v_and(near, enter_torus(c, d, s, near, in));
    }
}

// Rays with origin `o` and direction `d` in the shape's frame. Where they enter it ahead of their origin:
// how far, and the point there, on the surface to the rounding of its own size. `behind`: those that entered a
// convex solid before their origin, which may be inside. Not for planes.
INLINE vmask enter(struct vec o, struct vec d, const struct primitive *s, vmask active, vfloat *t,
                   struct vec *point, vmask *behind) {
    ACTIVE(v_count(active));
    COUNT(enter, call);
    vfloat before = v_splat(0.0f) - vec_dot(o, d);
    struct vec c = vec_along(o, d, before);
    vfloat square = vec_dot(c, c);
    vmask near = v_and(active, v_cmp_lt(square, v_splat(s->bound_sq)));
    *t = v_splat(INFINITY);
    *point = c;
    *behind = v_mask_none();
    if (!v_any(near))
        return near;
    ACTIVE(v_count(near));
    COUNT(enter, near);
    vfloat in, half = v_sqrt(v_max(v_splat(s->bound_sq) - square, v_splat(0.0f)));
    near = v_and(near, v_cmp_gt(before + half, v_splat(0.0f)));
    near = enter_nearby(c, d, before, half, NULL, s, near, &in);
    *t = before + in;
    *point = vec_along(c, d, in);
    vmask ahead = v_cmp_gt(*t, v_splat(0.0f));
    *behind = v_andnot(ahead, near);
    return v_and(near, ahead);
}

// Of a larger rounding, by its share of the bounding sphere, a point on the surface knows its radius to 1e-3, of which one
// of Newton's steps leaves 1e-6: no root, no quotient.
#define ROUNDING_SHARE 0x1p-10f

// Outward, of unit length, in the shape's frame, at points on its surface.
// 1/length by a step of Newton's from `per`, near to it: of what float misses a solid by, far from the origin, a normal
// is not to be longer or shorter.
static inline vfloat per_length(vfloat square, float per) {
    return v_splat(per) * v_nmadd(square * v_splat(0.5f), v_splat(per * per), v_splat(1.5f));
}

INLINE struct vec normal_on(struct vec p, const struct primitive *s) {
    COUNT(normal_on, call);
    vfloat one = v_splat(1.0f);
    switch (s->type) {
    case SHAPE_SPHERE:
        COUNT(normal_on, sphere);
        COUNT(normal_on, sphere_scalar);
        return vec_scale(p, per_length(vec_dot(p, p), 1.0f / s->a));
    case SHAPE_BOX: {
        COUNT(normal_on, box);
        vfloat x = v_abs(p.x) - v_splat(s->size[0]), y = v_abs(p.y) - v_splat(s->size[1]);
        vfloat z = v_abs(p.z) - v_splat(s->size[2]);
        vmask on_x = v_and(v_cmp_ge(x, y), v_cmp_ge(x, z)), on_y = v_andnot(on_x, v_cmp_ge(y, z));
        return (struct vec){v_copysign(v_select_or_zero(on_x, one), p.x),
                            v_copysign(v_select_or_zero(on_y, one), p.y),
                            v_copysign(v_zero_where(v_or(on_x, on_y), one), p.z)};
    }
    case SHAPE_ROUNDED_BOX: {
        COUNT(normal_on, rounded);
        vfloat x = v_abs(p.x) - v_splat(s->size[0]), y = v_abs(p.y) - v_splat(s->size[1]);
        vfloat z = v_abs(p.z) - v_splat(s->size[2]), most = v_max(x, v_max(y, z));
        // Where float does not see the rounding it is a box.
        vmask sharp = v_cmp_ge(v_splat(0.0f), most), on_x = v_cmp_ge(x, most),
              on_y = v_cmp_ge(y, most);
        struct vec away = {v_max(x, v_splat(0.0f)), v_max(y, v_splat(0.0f)),
                           v_max(z, v_splat(0.0f))};
        struct vec face = {v_select_or_zero(on_x, one), v_select_or_zero(v_andnot(on_x, on_y), one),
                           v_zero_where(v_or(on_x, on_y), one)};
        vfloat per;
        if (s->a > ROUNDING_SHARE * s->bound) {
            COUNT(normal_on, round);
            COUNT(normal_on, round_scalar);
            per = per_length(vec_dot(away, away), 1.0f / s->a);
        } else {
            COUNT(normal_on, square);
            per = one / vec_norm(away);
        }
        away = vec_select(sharp, face, vec_scale(away, per));
        return (struct vec){v_copysign(away.x, p.x), v_copysign(away.y, p.y),
                            v_copysign(away.z, p.z)};
    }
    case SHAPE_CONE: {
        COUNT(normal_on, cone);
        COUNT(normal_on, cone_scalar);
        vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z)), k = v_splat(s->slope[0] / s->slope[1]);
        vfloat side = radius - v_madd(k, p.y, v_splat(0.5f * (s->a + s->b)));
        float per = 1.0f / sqrtf(1.0f + s->slope[0] * s->slope[0] / (s->slope[1] * s->slope[1]));
        vmask cap = v_cmp_gt(v_abs(p.y) - v_splat(s->c), side * v_splat(per));
        vfloat out = v_splat(per) / v_max(radius, v_splat(1e-30f));
        return (struct vec){v_zero_where(cap, p.x * out),
                            v_select(cap, v_copysign(one, p.y), k * v_splat(-per)),
                            v_zero_where(cap, p.z * out)};
    }
    case SHAPE_OCTAHEDRON: {
        vfloat part = v_splat(0.57735026918962576451f);
        return (struct vec){v_copysign(part, p.x), v_copysign(part, p.y), v_copysign(part, p.z)};
    }
    default: {
        COUNT(normal_on, torus);
        vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
        vfloat outward = one - v_splat(s->a) / v_max(radius, v_splat(1e-30f));
        struct vec n = {p.x * outward, p.y, p.z * outward};
        return vec_scale(n, one / v_max(vec_norm(n), v_splat(1e-30f)));
    }
    }
}

#endif
