// Where rays enter a torus: the only solid that is marched.
#include "hit/quotient.h"
#include "hit/solids.h"

// Sphere tracing with two accelerations. First, the hull: the distance to the disc that fills the ring, less
// the tube's radius, is convex along a ray and nowhere above the torus's distance h. So Newton's step on it
// never goes too far, and a ray that no longer approaches it has missed. Second, h bends down by 1/radius at
// most. A parabola with 4/3 of that bounds the surface while the radius falls by less than a quarter, and is
// Newton's step where h is small. Steps of h alone lose rays along the ring's inner side: more than 256
// steps.
KERNEL_INLINE vmask enter_torus(struct vec c, struct vec d, const struct primitive *s, vmask near,
                                vfloat *t) {
    vfloat zero = v_splat(0.0f), one = v_splat(1.0f), bound = v_splat(s->bound);
    vfloat tiny = v_splat(1e-30f);
    // The ray enters between two planes and in the cylinder about the ring. Both are 2^-10 wider for
    // rounding.
    float wide = 1 + 0x1p-10f, outer_sq = wide * wide * s->bound_sq;
    vfloat per = quotient(one, v_copysign(v_max(v_abs(d.y), v_splat(1e-12f)), d.y));
    vfloat width = v_splat(wide * s->b) * v_abs(per), middle = c.y * per;
    vfloat square = v_max(v_madd(d.x, d.x, d.z * d.z), v_splat(1e-12f));
    vfloat b = v_madd(c.x, d.x, c.z * d.z), far = v_madd(c.x, c.x, c.z * c.z);
    vfloat inside = v_nmadd(square, far - v_splat(outer_sq), b * b);
    vfloat half = v_sqrt(v_max(inside, zero)), per_square = quotient(one, square);
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
        vfloat per_radius = quotient(one, v_max(radius, tiny));
        vfloat rate = v_madd(p.x, d.x, p.z * d.z) * per_radius; // derivative of the radius
        vfloat fall =                                           // derivative of h
            quotient(v_madd(ring, rate, p.y * d.y), v_max(tube, tiny));
        vfloat hull_fall = v_select(outer, fall, v_negate_where(v_signbit(p.y), d.y));
        vmask reached = v_and(going, v_cmp_lt(v_abs(h), v_splat(s->c))),
              outside = v_cmp_gt(h, zero);
        vfloat bent =
            v_sqrt(v_max(v_madd(fall, fall, h * v_splat(8.0f / 3.0f) * per_radius), zero));
        // Inside the tube: Newton's step back.
        vfloat below = v_select(outside, v_max(bent - fall, v_splat(1e-6f)),
                                v_max(zero - fall, v_splat(0.05f)));
        vfloat newton = quotient(v_select(outside, h * v_splat(2 * (1 - SHORTER)), h), below);
        vfloat safe = v_max(h, v_min(newton, radius * v_splat(0.25f)));
        vfloat hull_step =
            quotient(hull * v_splat(1 - SHORTER), v_max(zero - hull_fall, v_splat(1e-6f)));
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
