// Where rays enter a torus: opt9_convex's march with approximate quotients.
#include "hit/solids.h"

// Returns 1/a for normal a to 1e-5, with the sign of a, the same for any number of lanes: a linear guess from
// the bits and two of Newton's steps. The divider takes 15 cycles for sixteen quotients.
static inline vfloat near_inverse(vfloat a) {
    typedef unsigned whole __attribute__((vector_size(sizeof(vfloat))));
    vfloat r = (vfloat)(0x7ef311c3u - (whole)a);
    r = r * v_nmadd(a, r, v_splat(2.0f));
    return r * v_nmadd(a, r, v_splat(2.0f));
}

// Steps as in opt9_convex's hit/torus.c, which says why none goes too far. A quotient errs by less than 1e-5,
// so Newton's steps are shortened by 2e-4 to stay short of the surface.
KERNEL_INLINE vmask enter_torus(struct vec c, struct vec d, const struct primitive *s, vmask near,
                                vfloat *t) {
    vfloat zero = v_splat(0.0f), bound = v_splat(s->bound), tiny = v_splat(1e-30f);
    // The ray enters between two planes and in the cylinder about the ring. Both are 2^-10 wider for
    // rounding.
    float wide = 1 + 0x1p-10f, outer_sq = wide * wide * s->bound_sq;
    vfloat per = near_inverse(v_copysign(v_max(v_abs(d.y), v_splat(1e-12f)), d.y));
    vfloat width = v_splat(wide * s->b) * v_abs(per), middle = c.y * per;
    vfloat square = v_max(v_madd(d.x, d.x, d.z * d.z), v_splat(1e-12f));
    vfloat b = v_madd(c.x, d.x, c.z * d.z), far = v_madd(c.x, c.x, c.z * c.z);
    vfloat inside = v_nmadd(square, far - v_splat(outer_sq), b * b);
    vfloat half = v_sqrt(v_max(inside, zero)), per_square = near_inverse(square);
    vfloat at = v_max(v_max(*t, zero - middle - width), (zero - b - half) * per_square);
    vfloat out = v_min(width - middle, (half - b) * per_square);
    near = v_and(near, v_and(v_cmp_ge(inside, zero), v_cmp_ge(out, at)));
    vmask going = near, found = v_mask_none();
    if (!v_any(going))
        return going;
    for (int step = 0; step < 256; step++) {
        struct vec p = vec_along(c, d, at);
        vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z)), ring = radius - v_splat(s->a);
        vfloat tube = v_sqrt(v_madd(ring, ring, p.y * p.y));
        vmask outer = v_cmp_gt(ring, zero);
        vfloat h = tube - v_splat(s->b);
        vfloat hull = v_select(outer, h, v_abs(p.y) - v_splat(s->b));
        vfloat per_radius = near_inverse(v_max(radius, tiny));
        vfloat rate = v_madd(p.x, d.x, p.z * d.z) * per_radius; // derivative of the radius
        vfloat fall =
            v_madd(ring, rate, p.y * d.y) * near_inverse(v_max(tube, tiny)); // derivative of h
        vfloat hull_fall = v_select(outer, fall, v_negate_where(v_signbit(p.y), d.y));
        vmask reached = v_and(going, v_cmp_lt(v_abs(h), v_splat(s->c))),
              outside = v_cmp_gt(h, zero);
        vfloat bent =
            v_sqrt(v_max(v_madd(fall, fall, h * v_splat(8.0f / 3.0f) * per_radius), zero));
        // Inside the tube: Newton's step back.
        vfloat below = v_select(outside, v_max(bent - fall, v_splat(1e-6f)),
                                v_max(zero - fall, v_splat(0.05f)));
        vfloat newton =
            v_select(outside, h * v_splat(2.0f * (1.0f - 2e-4f)), h) * near_inverse(below);
        vfloat safe = v_max(h, v_min(newton, radius * v_splat(0.25f)));
        vfloat hull_step = hull * v_splat(1.0f - 2e-4f) * // stays short of the hull
                           near_inverse(v_max(zero - hull_fall, v_splat(1e-6f)));
        vfloat ahead = v_select(v_cmp_gt(hull, zero), v_max(safe, hull_step), safe);
        vmask back = v_andnot(outside, v_cmp_lt(fall, zero));
        at = v_select(going, at + v_select(back, newton, v_select(outside, ahead, h)), at);
        found = v_or(found, reached);
        vmask gone =
            v_or(v_and(v_cmp_gt(hull, zero), v_cmp_ge(hull_fall, zero)), v_cmp_gt(at, bound));
        going = v_andnot(v_or(reached, gone), going);
        if (!v_any(going))
            break;
    }
    *t = at;
    return found;
}
