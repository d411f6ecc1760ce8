// Cones about shadow rays, and what they say of a shape's distance along the ray.
#ifndef OPT10_CONE_H
#define OPT10_CONE_H

#include "bulb.h"
#include "convex.h"

// Cones of slope q about the ray that miss a sphere: |v − t·l| ≥ R + q·t for all t ≥ 0.
struct cone {
    real along, need, lean; // v·l, |v|² − R², v·l + q·R
};

INLINE struct cone cone_to(struct vec v, struct vec l, const struct placed *s, float q) {
    real along = vec_dot(v, l);
    return (struct cone){along, vec_dot(v, v) - set(s->bound_sq), along + set(q * s->bound)};
}

INLINE mask cone_misses(struct cone c, float q) {
    real lean = most_of(c.lean, set(0.0f));
    return less(lean * lean, set(1.0f - q * q) * c.need);
}

INLINE struct vec to_centre(const struct placed *s, struct vec p) {
    return (struct vec){set(s->position[0]) - p.x, set(s->position[1]) - p.y,
                        set(s->position[2]) - p.z};
}

// The slope that the cone to a shape needs.
INLINE float slope_to(const struct placed *s, float q) {
    return s->type == SHAPE_MANDELBULB ? fminf(q / BULB_SHARE, 1.0f) : q;
}

// A convex solid lies below the plane that touches it at the point: its distance grows by at least `facing`,
// and ever faster. So does the torus's, where the point is on its hull.
INLINE mask bulges(const struct placed *s, struct vec local) {
    if (s->convex)
        return all_lanes();
    if (s->type == SHAPE_MANDELBULB)
        return no_lane();
    real square = mul_add(local.x, local.x, local.z * local.z);
    return not_less(square, set(s->a * s->a));
}

INLINE mask plane_clears(real height, real slope, float q, const struct prepared *scene) {
    real furthest = set(2.0f * (float)scene->model.march.bounds_radius);
    return either(not_less(slope, set(q)),
                  both(greater(height, set(0.0f)),
                       greater(mul_add(furthest, slope - set(q), height), set(0.0f))));
}

// A packet of shadow rays in work.
struct rays {
    mask active;
    struct vec point, local, to_light;
    real facing, shape;
    real end;   // behind it no term comes below 1
    real alone; // before it nothing is nearer than the plane that the ray is from
    mask on_plane;
    real first, cosine; // the first entry into a solid, of those that can be met
};

// The shapes that can be the nearest somewhere before the rays' end, with their own view of the rays.
SHARED void choose_shapes(struct rays *r, struct near *nears, struct shapes *casters,
                          const struct convex *work);

#endif
