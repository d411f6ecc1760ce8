// The march of hit/torus.c (opt10_scene) in steps, so that two packets can take them in turns, with three differences.
// Roots are inverse roots, which give the quotients too. Further from the axis than the ring h is the hull's distance,
// convex along the ray: Newton's step alone. A step that provably ends on the surface is the last. After a step of
// length x the height is at most x²/2·(1/tube + 4/3/radius), as h bends by no more than that.
#pragma once

#include "hit/quotient.h"
#include "hit/solids.h"

struct torus_march {
    vfloat at, out;
    vmask going, found;
};

INLINE void begin_torus(struct vec c, struct vec d, const struct primitive *s, vmask near,
                        vfloat from, struct torus_march *w) {
    vfloat zero = v_splat(0.0f);
    // The ray enters between two planes and in the cylinder about the ring. Both are 2^-10 wider for
    // rounding.
    float wide = 1 + 0x1p-10f, outer_sq = wide * wide * s->bound_sq;
    vfloat per = near_inverse(v_copysign(v_max(v_abs(d.y), v_splat(1e-12f)), d.y));
    vfloat width = v_splat(wide * s->b) * v_abs(per), middle = c.y * per;
    vfloat square = v_max(v_madd(d.x, d.x, d.z * d.z), v_splat(1e-12f));
    vfloat b = v_madd(c.x, d.x, c.z * d.z), far = v_madd(c.x, c.x, c.z * c.z);
    vfloat inside = v_nmadd(square, far - v_splat(outer_sq), b * b);
    vfloat half = v_sqrt(v_max(inside, zero)), per_square = near_inverse(square);
    w->at = v_max(v_max(from, zero - middle - width), (zero - b - half) * per_square);
    w->out = v_min(width - middle, (half - b) * per_square);
    w->going = v_and(near, v_and(v_cmp_ge(inside, zero), v_cmp_ge(w->out, w->at)));
    w->found = v_mask_none();
}

// Why no step goes too far: hit/torus.c of opt9_convex.
INLINE void step_torus(struct vec c, struct vec d, const struct primitive *s,
                       struct torus_march *w) {
    vfloat zero = v_splat(0.0f), tiny = v_splat(1e-30f), least = v_splat(1e-6f);
    struct vec p = vec_along(c, d, w->at);
    vfloat square = v_max(v_madd(p.x, p.x, p.z * p.z), tiny), per_radius = v_rsqrt_newton(square);
    vfloat radius = square * per_radius, ring = radius - v_splat(s->a);
    vfloat tube_sq = v_max(v_madd(ring, ring, p.y * p.y), tiny), per_tube = v_rsqrt_newton(tube_sq);
    vfloat h = v_msub(tube_sq, per_tube, v_splat(s->b));
    vfloat rate = v_madd(p.x, d.x, p.z * d.z) * per_radius; // derivative of the radius
    vfloat fall = v_madd(ring, rate, p.y * d.y) * per_tube; // derivative of h
    vmask reached = v_cmp_lt_in(w->going, v_abs(h), v_splat(s->c)), outside = v_cmp_gt(h, zero);
    // Only where `bends` is h not convex along the ray.
    vmask hull = v_cmp_gt_in(outside, ring, zero), bends = v_andnot(hull, outside);
    vfloat more = v_select_or_zero(bends, h * v_splat(8.0f / 3.0f) * per_radius);
    vfloat bent_sq = v_max(v_madd(fall, fall, more), tiny);
    vfloat bent = bent_sq * v_rsqrt_newton(bent_sq);
    // Where h does not bend: twice the fall. Inside the tube the step leads back.
    vfloat below = v_max(bent - fall, v_select(outside, least, v_splat(0.1f)));
    vfloat whole = (h + h) * near_inverse(below), newton = whole * v_splat(1.0f - 2e-4f);
    vfloat safe = v_max(h, v_min(newton, radius * v_splat(0.25f)));
    vmask back = v_andnot(outside, v_cmp_ge(fall, zero));
    vfloat step = v_select(back, h, v_select(bends, safe, newton));
    vfloat bend = v_madd(v_splat(2.0f / 3.0f), per_radius, v_splat(0.5f / s->b));
    vmask last = v_cmp_lt_in(v_and(w->going, outside), whole * whole * bend, v_splat(0.5f * s->c));
    last = v_cmp_ge_in(last, newton, step);
    w->at = v_add_where(w->going, w->at, v_select(last, whole, step));
    reached = v_or(reached, last);
    w->found = v_or(w->found, reached);
    vmask gone = v_or(v_cmp_ge_in(hull, fall, zero), v_cmp_gt(w->at, w->out));
    w->going = v_andnot(v_or(reached, gone), w->going);
}

enum { MOST_TORUS_STEPS = 256 };
