// Where rays enter solids, in closed form, and the normals there. A box and an octahedron are the
// intersections of 3 and 4 pairs of parallel planes (T. L. Kay and J. T. Kajiya, "Ray tracing complex
// scenes", SIGGRAPH 1986); sphere and cone are quadratics; the torus alone is marched.
//
// Every ray first moves along itself to its nearest point to the shape's position. The rest is then rounded
// at the size of the shape and not at that of the distance to it.
#pragma once

#include "simd/simd.h"

#include "fields/rays.h"
#include "types/known_scene.h"

static inline vfloat inverse_of(vfloat d) { // of a component of a direction; 0 becomes 1e-20
    return v_splat(1.0f) / v_copysign(v_max(v_abs(d), v_splat(1e-20f)), d);
}

// Returns all three inverses by one quotient. Components below 1e-12 count as 1e-12.
static inline struct vec inverses_of(struct vec d) {
    vfloat least = v_splat(1e-12f);
    vfloat x = v_copysign(v_max(v_abs(d.x), least), d.x);
    vfloat y = v_copysign(v_max(v_abs(d.y), least), d.y);
    vfloat z = v_copysign(v_max(v_abs(d.z), least), d.z);
    vfloat yz = y * z, per = v_splat(1.0f) / (x * yz), of_x = per * x;
    return (struct vec){per * yz, of_x * z, of_x * y};
}

// Clips rays to the space between two planes at distance `half` from the origin. c: the rays' position across
// the planes; per: the inverse of their direction's component. `in` never exceeds `out`.
INLINE void slab(vfloat c, vfloat per, float half, vfloat *in, vfloat *out) {
    vfloat middle = c * per, width = v_splat(half) * v_abs(per);
    *in = v_max(*in, v_splat(0.0f) - middle - width);
    *out = v_min(*out, width - middle);
}

INLINE vmask enter_box(struct vec c, struct vec per, const struct primitive *s, vfloat *t) {
    vfloat out = v_splat(INFINITY);
    *t = v_splat(-INFINITY);
    slab(c.x, per.x, s->size[0], t, &out);
    slab(c.y, per.y, s->size[1], t, &out);
    slab(c.z, per.z, s->size[2], t, &out);
    return v_cmp_ge(out, *t);
}

// Newton's steps from where the ray enters the box with sharp edges, for the square of the distance to the
// inner box = the square of the rounding. That is convex along a ray: no step goes too far, and a ray that
// comes no nearer has missed. away (may be NULL): from the inner box to the entry point.
INLINE vmask enter_rounded_box(struct vec c, struct vec d, struct vec per,
                               const struct primitive *s, vmask near, vfloat *t, struct vec *away) {
    vfloat zero = v_splat(0.0f), out = v_splat(INFINITY), at = v_splat(-INFINITY);
    float close = 0x1p-22f * s->bound, within = (s->a + close) * (s->a + close);
    slab(c.x, per.x, s->size[0] + s->a, &at, &out);
    slab(c.y, per.y, s->size[1] + s->a, &at, &out);
    slab(c.z, per.z, s->size[2] + s->a, &at, &out);
    vmask going = v_and(near, v_cmp_ge(out, at)), found = v_mask_none();
    struct vec p = c;
    vfloat x = zero, y = zero, z = zero;
    for (int step = 0; step < 64 && v_any(going); step++) {
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
        vfloat rate =
            v_madd(x, v_negate_where(v_signbit(p.x), d.x), // derivative of half the square
                   v_madd(y, v_negate_where(v_signbit(p.y), d.y),
                          z * v_negate_where(v_signbit(p.z), d.z)));
        going = v_andnot(v_or(v_cmp_ge(rate, zero), v_cmp_gt(at, out)), going);
        at = v_select(going,
                      at - v_splat(0.5f) * (square - v_splat(s->a * s->a)) /
                               v_min(rate, v_splat(-1e-30f)),
                      at);
    }
    if (away)
        *away = (struct vec){v_copysign(x, p.x), v_copysign(y, p.y), v_copysign(z, p.z)};
    *t = at;
    return found;
}

INLINE vmask enter_octahedron(struct vec c, struct vec d, const struct primitive *s, vfloat *t) {
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

// Between the caps the cone is where x² + z² − (m + k·y)² ≤ 0. Along a ray that is A·t² + 2·B·t + C ≤ 0. The
// cone is convex there, so a ray enters it once: through a cap, or at the root at which the quadratic falls.
INLINE vmask enter_cone(struct vec c, struct vec d, const struct primitive *s, vfloat *t) {
    vfloat in = v_splat(-INFINITY), out = v_splat(INFINITY), zero = v_splat(0.0f), ahead = zero;
    bool oblate = fabsf(s->slope[0]) > CONE_OBLATE * s->slope[1];
    if (oblate) {
        // A·t² and C are slope² times as large as their sum. They are small if t counts from a point between
        // the caps.
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
    vmask towards = v_cmp_lt(b, zero); // chooses the form of the root without cancellation
    vfloat side = v_select(towards, cc, zero - b - r) / v_select(towards, r - b, a);
    // At the cap: is it within the rim?
    vmask cap = v_cmp_ge(zero, v_madd(in, v_madd(in, a, b + b), cc));
    *t = v_select(cap, in, side);
    vmask met = v_and(
        v_cmp_ge(out, in),
        v_or(cap, v_and(v_and(v_cmp_ge(square, zero), v_cmp_ge(side, in)), v_cmp_lt(side, out))));
    if (oblate) {
        *t = *t + ahead;
        // The quadratic is not exact this far above or below the caps.
        met = v_and(met, v_cmp_ge(v_splat(s->c + 1e-6f * s->bound), v_abs(c.y)));
    }
    return met;
}

// hit/torus.c. Returns which rays enter the torus, and sets t: how far from c.
KERNEL_INLINE vmask enter_torus(struct vec c, struct vec d, const struct primitive *s, vmask near,
                                vfloat *t);

// hit/sharp.c. Returns which rays come to the surface of a sharp group between `from` and `to`, and sets t. A ray that begins
// inside comes to it there.
vmask sharp_enter(const struct sharp *sharp, struct vec o, struct vec d, vmask active, vfloat from,
                  vfloat to, vfloat *t);

// Returns the surface of the leaf that decides at p, in the group's frame. Its normal points out of the leaf, which may be
// cut away.
struct field_surface sharp_surface(const struct sharp *sharp, struct vec p, vmask found);

static inline struct vec shared_inverses(struct vec d, const struct vec *known) {
    if (known)
        return *known;
    return (struct vec){inverse_of(d.x), inverse_of(d.y), inverse_of(d.z)};
}

// Returns which rays enter the shape, and sets `in`: how far from c. c: each ray's nearest point to the
// shape's position, `before` from its origin. d: the direction; per: its inverses (boxes only; NULL: not
// known). near: rays that meet the bounding sphere; half: half the length of the ray inside it (spheres and
// tori only). Not for planes.
INLINE vmask enter_nearby(struct vec c, struct vec d, vfloat before, vfloat half,
                          const struct vec *per, const struct primitive *s, vmask near,
                          vfloat *in) {
    if (IS_GROUP(s)) {
        vfloat from = v_max(v_splat(0.0f) - half, v_splat(0.0f) - before);
        return SHARP_OF(s) ? sharp_enter(SHARP_OF(s), c, d, near, from, half, in)
                           : field_enter(FIELD_OF(s), c, d, near, from, half, in);
    }
    switch (s->type) {
    case SHAPE_SPHERE: *in = v_splat(0.0f) - half; return near;
    case SHAPE_BOX: return v_and(near, enter_box(c, shared_inverses(d, per), s, in));
    case SHAPE_ROUNDED_BOX:
        return v_and(near, enter_rounded_box(c, d, shared_inverses(d, per), s, near, in, NULL));
    case SHAPE_CONE: return v_and(near, enter_cone(c, d, s, in));
    case SHAPE_OCTAHEDRON: return v_and(near, enter_octahedron(c, d, s, in));
    default:
        *in = v_max(v_splat(0.0f) - half, v_splat(0.0f) - before);
        return v_and(near, enter_torus(c, d, s, near, in));
    }
}

// Returns which rays enter the shape ahead of their origin. `o`, `d`: origin and direction in the shape's
// frame. t, point: where the ray enters, on the surface up to rounding at the shape's size. `behind`: rays
// that entered a convex solid behind their origin, which may be inside. Not for planes.
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
    vfloat in, half = v_sqrt(v_max(v_splat(s->bound_sq) - square, v_splat(0.0f)));
    near = v_and(near, v_cmp_gt(before + half, v_splat(0.0f)));
    near = enter_nearby(c, d, before, half, NULL, s, near, &in);
    *t = before + in;
    *point = vec_along(c, d, in);
    vmask ahead = v_cmp_gt(*t, v_splat(0.0f));
    *behind = v_andnot(ahead, near);
    return v_and(near, ahead);
}

// A rounding above this share of the bounding sphere: at a point on the surface, float knows its radius to
// 1e-3. One of Newton's steps reduces that to 1e-6, without a root or a quotient.
#define ROUNDING_SHARE 0x1p-10f

// Returns 1/length by one of Newton's steps from `per`, which is near to it. square: the squared length. Far
// from the origin, float puts a point off the surface; the step keeps its normal at unit length.
static inline vfloat per_length(vfloat square, float per) {
    return v_splat(per) * v_nmadd(square * v_splat(0.5f), v_splat(per * per), v_splat(1.5f));
}

INLINE struct vec normal_on_rounded_box(struct vec p, const struct primitive *s) {
    vfloat one = v_splat(1.0f);
    vfloat x = v_abs(p.x) - v_splat(s->size[0]), y = v_abs(p.y) - v_splat(s->size[1]);
    vfloat z = v_abs(p.z) - v_splat(s->size[2]), most = v_max(x, v_max(y, z));
    // Where the rounding is lost in float, the shape is a box.
    vmask sharp = v_cmp_ge(v_splat(0.0f), most), on_x = v_cmp_ge(x, most), on_y = v_cmp_ge(y, most);
    struct vec away = {v_max(x, v_splat(0.0f)), v_max(y, v_splat(0.0f)), v_max(z, v_splat(0.0f))};
    struct vec face = {v_select_or_zero(on_x, one), v_select_or_zero(v_andnot(on_x, on_y), one),
                       v_zero_where(v_or(on_x, on_y), one)};
    vfloat per;
    if (s->a > ROUNDING_SHARE * s->bound)
        per = per_length(vec_dot(away, away), 1.0f / s->a);
    else
        per = one / vec_norm(away);
    away = vec_select(sharp, face, vec_scale(away, per));
    return (struct vec){v_copysign(away.x, p.x), v_copysign(away.y, p.y), v_copysign(away.z, p.z)};
}

INLINE struct vec normal_on_cone(struct vec p, const struct primitive *s) {
    vfloat one = v_splat(1.0f);
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z)), k = v_splat(s->slope[0] / s->slope[1]);
    vfloat side = radius - v_madd(k, p.y, v_splat(0.5f * (s->a + s->b)));
    float per = 1.0f / sqrtf(1.0f + s->slope[0] * s->slope[0] / (s->slope[1] * s->slope[1]));
    vmask cap = v_cmp_gt(v_abs(p.y) - v_splat(s->c), side * v_splat(per));
    vfloat out = v_splat(per) / v_max(radius, v_splat(1e-30f));
    return (struct vec){v_zero_where(cap, p.x * out),
                        v_select(cap, v_copysign(one, p.y), k * v_splat(-per)),
                        v_zero_where(cap, p.z * out)};
}

// Returns the outward unit normals at points on the shape's surface, in its frame. Not for planes.
INLINE struct vec normal_on(struct vec p, const struct primitive *s) {
    vfloat one = v_splat(1.0f);
    switch (s->type) {
    case SHAPE_SPHERE: return vec_scale(p, per_length(vec_dot(p, p), 1.0f / s->a));
    case SHAPE_BOX: {
        vfloat x = v_abs(p.x) - v_splat(s->size[0]), y = v_abs(p.y) - v_splat(s->size[1]);
        vfloat z = v_abs(p.z) - v_splat(s->size[2]);
        vmask on_x = v_and(v_cmp_ge(x, y), v_cmp_ge(x, z)), on_y = v_andnot(on_x, v_cmp_ge(y, z));
        return (struct vec){v_copysign(v_select_or_zero(on_x, one), p.x),
                            v_copysign(v_select_or_zero(on_y, one), p.y),
                            v_copysign(v_zero_where(v_or(on_x, on_y), one), p.z)};
    }
    case SHAPE_ROUNDED_BOX: return normal_on_rounded_box(p, s);
    case SHAPE_CONE: return normal_on_cone(p, s);
    case SHAPE_OCTAHEDRON: {
        vfloat part = v_splat(0.57735026918962576451f);
        return (struct vec){v_copysign(part, p.x), v_copysign(part, p.y), v_copysign(part, p.z)};
    }
    default: {
        vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
        vfloat outward = one - v_splat(s->a) / v_max(radius, v_splat(1e-30f));
        struct vec n = {p.x * outward, p.y, p.z * outward};
        return vec_scale(n, one / v_max(vec_norm(n), v_splat(1e-30f)));
    }
    }
}
