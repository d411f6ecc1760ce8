// The march of hit/torus.c (opt10_scene) in steps, so that two packets can take them in turns, with two differences. Roots
// are inverse roots, which give the quotients too. And a step that provably ends on the surface is the last: after a step
// of length x from the height h, the height is at most x²/2·(1/tube + 4/3/radius), as h bends by no more than that.
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
    vfloat zero = v_splat(0.0f), tiny = v_splat(1e-30f), most = v_splat(1e-6f);
    struct vec p = vec_along(c, d, w->at);
    vfloat square = v_max(v_madd(p.x, p.x, p.z * p.z), tiny), per_radius = v_rsqrt_newton(square);
    vfloat radius = square * per_radius, ring = radius - v_splat(s->a);
    vfloat tube_sq = v_max(v_madd(ring, ring, p.y * p.y), tiny), per_tube = v_rsqrt_newton(tube_sq);
    vmask outer = v_cmp_gt(ring, zero);
    vfloat h = v_msub(tube_sq, per_tube, v_splat(s->b));
    vfloat hull = v_select(outer, h, v_abs(p.y) - v_splat(s->b));
    vfloat rate = v_madd(p.x, d.x, p.z * d.z) * per_radius; // derivative of the radius
    vfloat fall = v_madd(ring, rate, p.y * d.y) * per_tube; // derivative of h
    vfloat hull_fall = v_select(outer, fall, v_negate_where(v_signbit(p.y), d.y));
    vmask reached = v_and(w->going, v_cmp_lt(v_abs(h), v_splat(s->c))), outside = v_cmp_gt(h, zero);
    vfloat bent_sq = v_max(v_madd(fall, fall, h * v_splat(8.0f / 3.0f) * per_radius), tiny);
    vfloat bent = bent_sq * v_rsqrt_newton(bent_sq);
    // Inside the tube: Newton's step back.
    vfloat below = v_select(outside, v_max(bent - fall, most), v_max(zero - fall, v_splat(0.05f)));
    vfloat whole = (h + h) * near_inverse(below);
    vfloat newton = v_select(outside, whole * v_splat(1.0f - 2e-4f), v_splat(0.5f) * whole);
    vfloat safe = v_max(h, v_min(newton, radius * v_splat(0.25f)));
    vfloat hull_step = hull * v_splat(1.0f - 2e-4f) * // stays short of the hull
                       near_inverse(v_max(zero - hull_fall, most));
    vfloat ahead = v_select(v_cmp_gt(hull, zero), v_max(safe, hull_step), safe);
    vmask back = v_andnot(outside, v_cmp_lt(fall, zero));
    vfloat bend = v_madd(v_splat(2.0f / 3.0f), per_radius, v_splat(0.5f / s->b));
    vmask last =
        v_and(v_cmp_lt_in(v_and(w->going, outside), whole * whole * bend, v_splat(0.5f * s->c)),
              v_cmp_ge(newton, ahead));
    vfloat step = v_select(back, newton, v_select(outside, ahead, h));
    step = v_select(last, whole, step);
    w->at = v_select(w->going, w->at + step, w->at);
    reached = v_or(reached, last);
    w->found = v_or(w->found, reached);
    vmask gone = v_or(v_and(v_cmp_gt(hull, zero), v_cmp_ge(hull_fall, zero)),
                      v_cmp_gt(w->at, v_splat(s->bound)));
    w->going = v_andnot(v_or(reached, gone), w->going);
}

enum { MOST_TORUS_STEPS = 256 };
