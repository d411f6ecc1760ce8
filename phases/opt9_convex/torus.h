// Where rays enter a torus: a march, the only one among the solids.
#ifndef OPT9_TORUS_H
#define OPT9_TORUS_H

#include "sdf.h"

// Sphere tracing, helped by what is convex: the distance to the disc that fills the ring, less the tube's
// radius, is a convex function along a ray, and nowhere larger than the torus's. So Newton's step on it never
// goes too far, and a ray that no longer comes nearer to it has missed. Of the torus's own distance h no more than 1/radius
// bends down along a ray: a parabola of 4/3 of that says how far no surface can be, as long as the radius falls by less
// than a quarter, and where h is small it is Newton's step. Steps of h alone were more than 256 where a ray follows the
// ring's inner side, and it was lost.
INLINE mask enter_torus(struct vec c, struct vec d, const struct placed *s, mask near, real *t) {
    COUNT(enter_torus, call);
    COUNT(enter_torus, exact);
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

#endif
