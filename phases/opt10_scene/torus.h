// Where rays enter a torus: opt9_convex's march, whose quotients are near ones.
#ifndef OPT9_TORUS_H
#define OPT9_TORUS_H

#include "sdf.h"

// 1/a for normal a, to 1e-5, with the sign of a, the same for any number of lanes: a line through the exponent and
// Newton's step twice. For where a quotient need not be exact: the divider takes 15 cycles for sixteen of them.
static inline real near_inverse(real a) {
    typedef unsigned whole __attribute__((vector_size(sizeof(real))));
    real r = (real)(0x7ef311c3u - (whole)a);
    r = r * neg_mul_add(a, r, set(2.0f));
    return r * neg_mul_add(a, r, set(2.0f));
}

// Steps as in opt9_convex's torus.h, which says why none goes too far. A near quotient errs by less than 1e-5, and the steps by
// Newton's rule are shorter by 2e-4, so that they stay short of the surface, too.
INLINE mask enter_torus(struct vec c, struct vec d, const struct placed *s, mask near, real *t) {
    COUNT(enter_torus, call);
    COUNT(enter_torus, near);
    COUNT(enter_torus, scalar);
    real zero = set(0.0f), bound = set(s->bound), tiny = set(1e-30f);
    // Not before it is between two planes and in the cylinder about the ring; 2^-10 wider, for quotients are near.
    float wide = 1 + 0x1p-10f, outer_sq = wide * wide * s->bound_sq;
    real per = near_inverse(with_sign_of(d.y, most_of(absolute(d.y), set(1e-12f))));
    real width = set(wide * s->b) * absolute(per), middle = c.y * per;
    real square = most_of(mul_add(d.x, d.x, d.z * d.z), set(1e-12f));
    real lean = mul_add(c.x, d.x, c.z * d.z), far = mul_add(c.x, c.x, c.z * c.z);
    real inside = neg_mul_add(square, far - set(outer_sq), lean * lean);
    real half = root(most_of(inside, zero)), per_square = near_inverse(square);
    real at = most_of(most_of(*t, zero - middle - width), (zero - lean - half) * per_square);
    real out = least_of(width - middle, (half - lean) * per_square);
    near = both(near, both(not_less(inside, zero), not_less(out, at)));
    mask going = near, found = no_lane();
    if (!any(going))
        return going;
    for (int step = 0; step < 256; step++) {
        ACTIVE(count_of(going));
        COUNT(enter_torus, near_step);
        struct vec p = vec_along(c, d, at);
        real radius = root(mul_add(p.x, p.x, p.z * p.z)), ring = radius - set(s->a);
        real tube = root(mul_add(ring, ring, p.y * p.y));
        mask outer = greater(ring, zero);
        real h = tube - set(s->b);
        real hull = choose(outer, h, absolute(p.y) - set(s->b));
        real per_radius = near_inverse(most_of(radius, tiny));
        real rate = mul_add(p.x, d.x, p.z * d.z) * per_radius; // of the radius
        real fall = mul_add(ring, rate, p.y * d.y) *
                    near_inverse(most_of(tube, tiny)); // of the torus's distance
        real hull_fall = choose(outer, fall, negate_where(negative(p.y), d.y));
        mask reached = both(going, less(absolute(h), set(s->c))), outside = greater(h, zero);
        real bent = root(most_of(mul_add(fall, fall, h * set(8.0f / 3.0f) * per_radius), zero));
        // From inside Newton's step back.
        real below =
            choose(outside, most_of(bent - fall, set(1e-6f)), most_of(zero - fall, set(0.05f)));
        real newton = choose(outside, h * set(2.0f * (1.0f - 2e-4f)), h) * near_inverse(below);
        real safe = most_of(h, least_of(newton, radius * set(0.25f)));
        real hull_step = hull * set(1.0f - 2e-4f) * // so that it stays short of the hull's
                         near_inverse(most_of(zero - hull_fall, set(1e-6f)));
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

#endif
