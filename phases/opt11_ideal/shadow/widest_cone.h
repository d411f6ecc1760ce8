// The widest cone about a ray that holds nothing of a solid: the least ratio h(t)/t of the solid's distance over
// a stretch of the ray. For a convex solid u·h(1/u) is a convex function of u = 1/t, so a root search in a
// bracket finds its minimum (PROOFS.md, 2. and 3.). A sphere needs no step.
#pragma once

#include "simd/simd.h"
#include "types/known_scene.h"

// Rays in a solid's frame. Only t from near to far counts.
struct cone_rays {
    struct vec o, d;
    vfloat near, far;
};

// A convex solid's distance h at a point of a ray, its derivative `slope` along the ray, and `bend` = H times
// the second derivative, H = h + core_radius().
struct along_ray {
    vfloat h, slope, bend;
};

// A solid is its core and all within this distance of it. Zero: it is its own core.
INLINE float core_radius(const struct primitive *s) {
    return s->type == SHAPE_ROUNDED_BOX ? s->a : s->type == SHAPE_TORUS ? s->b : 0.0f;
}

// Returns H = √square and its derivatives. half_slope: H·H'; across: H·H'' + H'², for a part of the surface
// that is flat or straight the squared part of the direction across it.
INLINE struct along_ray along_root(vfloat square, vfloat half_slope, vfloat across, float core) {
    vfloat per = v_rsqrt_newton(v_max(square, v_splat(1e-30f))), slope = half_slope * per;
    return (struct along_ray){v_msub(square, per, v_splat(core)), slope,
                              v_max(v_nmadd(slope, slope, across), v_splat(0.0f))};
}

// Returns 1/a to an ulp or two. The divider takes as long as ten other operations.
INLINE vfloat quick_inverse(vfloat a) {
    vfloat guess = v_rcp_approx(a);
    return guess * v_nmadd(a, guess, v_splat(2.0f));
}

INLINE vfloat outward(vfloat p, vfloat d) { // d, positive away from 0
    return v_negate_where(v_signbit(p), d);
}

// How far a coordinate is beyond [−half, half] at t, and the derivative of that. Sums with o come before those with t:
// close to a face the difference is exact.
INLINE vfloat beyond_slab(vfloat o, vfloat d, vfloat t, float half, vfloat *slope) {
    vfloat above = v_madd(d, t, o - v_splat(half));
    vfloat below = v_nmadd(d, t, v_splat(-half) - o);
    *slope = v_negate_where(v_cmp_lt(above, below), d);
    return v_max(v_max(above, below), v_splat(0.0f));
}

INLINE struct along_ray along_box(struct vec o, struct vec d, vfloat t, const struct primitive *s) {
    vfloat zero = v_splat(0.0f);
    struct vec slope;
    vfloat x = beyond_slab(o.x, d.x, t, s->size[0], &slope.x);
    vfloat y = beyond_slab(o.y, d.y, t, s->size[1], &slope.y);
    vfloat z = beyond_slab(o.z, d.z, t, s->size[2], &slope.z);
    vfloat half = v_madd(x, slope.x, v_madd(y, slope.y, z * slope.z));
    vfloat across = v_select_or_zero(v_cmp_gt(x, zero), d.x * d.x) +
                    (v_select_or_zero(v_cmp_gt(y, zero), d.y * d.y) +
                     v_select_or_zero(v_cmp_gt(z, zero), d.z * d.z));
    return along_root(v_madd(x, x, v_madd(y, y, z * z)), half, across, core_radius(s));
}

// Nearest to a point with |x| + |y| + |z| − radius = m is a face if no |coordinate| is below m/3. Else it is the
// edge between the two larger coordinates, or the vertex on the largest.
INLINE struct along_ray along_octahedron(struct vec p, struct vec d, const struct primitive *s) {
    vfloat zero = v_splat(0.0f), half = v_splat(0.5f), radius = v_splat(s->a);
    vfloat x = v_abs(p.x), y = v_abs(p.y), z = v_abs(p.z);
    vfloat dx = outward(p.x, d.x), dy = outward(p.y, d.y), dz = outward(p.z, d.z);
    vfloat m = x + y + z - radius, rise = dx + dy + dz;
    vfloat low = v_min(x, v_min(y, z)), high = v_max(x, v_max(y, z));
    vmask face = v_cmp_le(m, v_splat(3.0f) * low);
    vfloat d_low = v_select(v_cmp_le(x, low), dx, v_select(v_cmp_le(y, low), dy, dz));
    vfloat d_high = v_select(v_cmp_ge(x, high), dx, v_select(v_cmp_ge(y, high), dy, dz));
    vfloat both = m - low, d_both = rise - d_low; // of the two larger, less the radius
    vfloat middle = both + radius - high, d_middle = d_both - d_high, beyond = high - radius;
    vmask vertex = v_cmp_gt(beyond, middle);
    vfloat square = v_select(vertex, v_madd(beyond, beyond, middle * middle), half * both * both);
    vfloat rate = v_select(vertex, v_madd(beyond, d_high, middle * d_middle), half * both * d_both);
    vfloat across =
        v_select(vertex, v_madd(d_high, d_high, d_middle * d_middle), half * d_both * d_both);
    struct along_ray at = along_root(v_madd(low, low, square), v_madd(low, d_low, rate),
                                     v_madd(d_low, d_low, across), 0.0f);
    vfloat part = v_splat(0.57735026918962576451f);
    at.h = v_select(face, m * part, at.h);
    at.slope = v_select(face, rise * part, at.slope);
    at.bend = v_select(face, zero, at.bend);
    return at;
}

// The distance from the axis, radius, its derivative, and radius·second derivative.
struct ring_ray {
    vfloat radius, slope, bend, per;
};

INLINE struct ring_ray ring_along(struct vec p, struct vec d) {
    vfloat square = v_max(v_madd(p.x, p.x, p.z * p.z), v_splat(1e-30f));
    vfloat per = v_rsqrt_newton(square), slope = v_madd(p.x, d.x, p.z * d.z) * per;
    vfloat across = v_madd(d.x, d.x, d.z * d.z);
    return (struct ring_ray){square * per, slope,
                             v_max(v_nmadd(slope, slope, across), v_splat(0.0f)), per};
}

// Nearest is a cap if the point is over it, else a point of the side with its two rims: `across` from the side,
// and beyond a rim `past` along it.
INLINE struct along_ray along_cone(struct vec p, struct vec d, const struct primitive *s) {
    vfloat zero = v_splat(0.0f);
    struct ring_ray ring = ring_along(p, d);
    float per_length = sqrtf(s->per_slope_sq);
    float length = sqrtf(s->slope[0] * s->slope[0] + s->slope[1] * s->slope[1]);
    vfloat lean = v_splat(s->slope[0] * per_length), up = v_splat(s->slope[1] * per_length);
    vfloat x = ring.radius - v_splat(s->b), y = p.y - v_splat(s->c); // from the top rim
    vfloat across = v_msub(up, x, lean * y), d_across = v_msub(up, ring.slope, lean * d.y);
    vfloat along = v_madd(lean, x, up * y), d_along = v_madd(lean, ring.slope, up * d.y);
    vfloat past = along - v_min(v_max(along, v_splat(-length)), zero);
    vfloat out = v_abs(p.y) - v_splat(s->c);
    vfloat rim = v_select(v_signbit(p.y), v_splat(s->a), v_splat(s->b));
    vmask over = v_cmp_le(ring.radius, rim), above = v_cmp_gt(out, zero);
    vmask cap = v_and(over, above);
    // Second derivatives of `across` and `along`: those of the radius, times their slopes in it.
    vfloat second = ring.bend * ring.per;
    vfloat square = v_madd(past, past, across * across);
    vfloat half = v_madd(past, d_along, across * d_across);
    vfloat bends = v_madd(across * up, second, d_across * d_across);
    vmask beyond = v_cmp_gt(v_abs(past), zero);
    bends = bends + v_select_or_zero(beyond, v_madd(past * lean, second, d_along * d_along));
    struct along_ray at = along_root(square, half, bends, 0.0f);
    at.h = v_select(cap, out, at.h);
    at.slope = v_select(cap, outward(p.y, d.y), at.slope);
    at.bend = v_zero_where(cap, at.bend);
    vmask within = v_andnot(above, v_cmp_le(across, zero));
    at.h = v_zero_where(within, at.h);
    return at;
}

// The hull of a torus: all within the tube's radius of the disc that fills the ring. Where the distance from the
// axis is the ring's radius or more, its distance is the torus's.
INLINE struct along_ray along_hull(struct vec p, struct vec d, const struct primitive *s) {
    vfloat zero = v_splat(0.0f);
    struct ring_ray ring = ring_along(p, d);
    vfloat x = ring.radius - v_splat(s->a);
    vmask outer = v_cmp_gt(x, zero);
    vfloat out = v_select_or_zero(outer, x);
    vfloat curved = v_madd(ring.slope, ring.slope, x * ring.bend * ring.per);
    return along_root(v_madd(out, out, p.y * p.y), v_madd(out, ring.slope, p.y * d.y),
                      v_madd(d.y, d.y, v_select_or_zero(outer, curved)), s->b);
}

INLINE struct along_ray along_solid(const struct cone_rays *r, vfloat t,
                                    const struct primitive *s) {
    if (s->type == SHAPE_BOX || s->type == SHAPE_ROUNDED_BOX)
        return along_box(r->o, r->d, t, s);
    struct vec p = vec_along(r->o, r->d, t);
    switch (s->type) {
    case SHAPE_OCTAHEDRON: return along_octahedron(p, r->d, s);
    case SHAPE_CONE: return along_cone(p, r->d, s);
    default: return along_hull(p, r->d, s);
    }
}

enum { MOST_CONE_STEPS = 40 };

// How near to the least ratio a search has to come, for a scene of this shadow strength: 4e-6 of a shadow. The bound is
// seldom reached, because near a minimum Newton's steps are quadratic.
static inline float room_for(float strength) {
    return 0x1p-18f / (strength > 1.0f ? strength : 1.0f);
}

// The search along a packet of rays: where it looks next, between which t the minimum is, and what it found.
struct cone_search {
    vfloat t, low, high, best, where;
    vmask active;
    struct along_ray at; // the solid at t
    vfloat p;            // derivative of u·h(1/u) there
};

// Starts at the ray's nearest point to the centre, or where it sees the centre at the least angle. Which of them saves
// steps is counted, not derived.
INLINE void begin_cone_search(const struct cone_rays *r, const struct primitive *s, vfloat best,
                              vmask active, struct cone_search *w) {
    vfloat square = vec_dot(r->o, r->o), towards = v_splat(0.0f) - vec_dot(r->o, r->d);
    w->low = v_min(v_max(r->near, v_sqrt(square) - v_splat(s->bound)), r->far);
    w->high = r->far;
    vfloat t = towards;
    if (s->type != SHAPE_OCTAHEDRON && s->type != SHAPE_TORUS)
        t = square * quick_inverse(v_max(towards, v_splat(1e-20f)));
    w->t = w->where = v_min(v_max(t, w->low), w->high);
    w->best = best;
    w->active = active;
}

// Looks at w->t. Rays whose minimum is found leave w->active.
INLINE void look_for_cone(const struct cone_rays *r, const struct primitive *s, vfloat room,
                          struct cone_search *w) {
    vfloat zero = v_splat(0.0f), t = w->t;
    struct along_ray at = w->at = along_solid(r, t, s);
    vfloat per = quick_inverse(t), ratio = at.h * per;
    vfloat p = w->p = v_nmadd(t, at.slope, at.h);
    vmask less = v_and(w->active, v_cmp_lt(ratio, w->best)), later = v_cmp_gt(p, zero);
    w->best = v_select(less, v_max(ratio, zero), w->best);
    w->where = v_select(less, t, w->where);
    vfloat end = v_select(later, w->high, w->low); // the minimum is between t and there
    w->low = v_select(later, t, w->low);
    w->high = v_select(later, w->high, t);
    // By convexity it is no less than the ratio minus this.
    vfloat above = v_abs(p) * v_abs(end - t) * per;
    vmask close = v_cmp_ge(v_max(room, ratio - w->best) * end, above);
    w->active = v_andnot(v_or(close, v_cmp_le(w->best, room)), w->active);
}

// A step in 1/t: Newton's for a root of H/t times the derivative of h/t. With core 0 that is Newton's step for the minimum of
// half the square of h/t, exact where the nearest part is a point or a line; with a core no step is exact (PROOFS.md, 3.).
INLINE void step_cone_search(const struct primitive *s, int step, struct cone_search *w) {
    vfloat zero = v_splat(0.0f), core = v_splat(core_radius(s)), t = w->t, p = w->p;
    vfloat height = w->at.h + core, e = v_madd(p + core, p, t * t * w->at.bend);
    vfloat rest = v_nmadd(height, p, e), next = t * e * quick_inverse(rest);
    vmask inside = v_and(v_and(v_cmp_gt(rest, zero), v_cmp_gt(e, zero)),
                         v_and(v_cmp_gt(next, w->low), v_cmp_lt(next, w->high)));
    w->t = v_select(inside, next, v_select(v_cmp_gt(p, zero), w->high, w->low));
    // Newton's steps can go to and fro between two parts of a surface: halving ends that.
    if (step >= 4 && step % 2 == 0)
        w->t = v_splat(0.5f) * (w->low + w->high);
}

// Returns the lesser of `best` and the least ratio of the convex solid s (a torus: of its hull), to within
// `room`. *where: t of the least ratio found. Other lanes keep `best`.
INLINE vfloat widest_convex(const struct cone_rays *r, const struct primitive *s, vfloat best,
                            vmask active, vfloat room, vfloat *where) {
    struct cone_search w;
    begin_cone_search(r, s, best, active, &w);
    for (int step = 0; step < MOST_CONE_STEPS; step++) {
        ACTIVE(v_count(w.active));
        COUNT(widest_step, call);
        look_for_cone(r, s, room, &w);
        if (!v_any(w.active))
            break;
        step_cone_search(s, step, &w);
    }
    *where = w.where;
    return w.best;
}

// The same for a sphere, in closed form: the tangents from the origin, of this length, touch the sphere; their
// angle to the direction has this sine and cosine.
INLINE vfloat widest_sphere(const struct cone_rays *r, const struct primitive *s, vfloat best,
                            vmask active) {
    vfloat zero = v_splat(0.0f), radius = v_splat(s->a);
    vfloat towards = zero - vec_dot(r->o, r->d), square = vec_dot(r->o, r->o);
    struct vec away = vec_along(r->o, r->d, towards);
    vfloat across = v_sqrt(vec_dot(away, away)), power = v_nmadd(radius, radius, square);
    vfloat tangent = v_sqrt(v_max(power, zero)), per = v_splat(1.0f) / square;
    vfloat sine = v_msub(across, tangent, towards * radius) * per;
    vfloat cosine = v_madd(towards, tangent, across * radius) * per;
    vfloat touch = v_select(v_cmp_gt(cosine, zero), tangent / cosine, v_splat(INFINITY));
    vfloat t = v_min(v_max(touch, r->near), r->far);
    vmask ends = v_and(active, v_or(v_cmp_lt(touch, t), v_cmp_gt(touch, t)));
    if (v_any(ends)) {
        vfloat rise = v_madd(t, t - towards - towards, power);
        vfloat root = v_sqrt(v_max(v_madd(radius, radius, rise), zero));
        sine = v_select(ends, rise / ((root + radius) * t), sine);
    }
    return v_select(active, v_min(best, v_max(sine, zero)), best);
}
