// Cones about shadow rays, and what they say of a shape's distance along the ray: NOTES.md has the proofs.
#ifndef OPT8_CONE_H
#define OPT8_CONE_H

#include "streams.h"

// Cones of slope q about the ray that miss a sphere: |v − t·l| ≥ R + q·t for all t ≥ 0.
struct cone {
    real need, lean; // |v|² − R², v·l + q·R
};

static inline struct cone cone_to(struct vec v, struct vec l, const struct placed *s) {
    return (struct cone){vec_dot(v, v) - set(s->bound_sq), vec_dot(v, l) + set(s->lean)};
}

static inline mask cone_misses(struct cone c, const struct placed *s) {
    real lean = most_of(c.lean, set(0.0f));
    return less(lean * lean, set(s->wide) * c.need);
}

static inline struct vec to_centre(const struct placed *s, struct vec p) {
    return (struct vec){set(s->position[0]) - p.x, set(s->position[1]) - p.y,
                        set(s->position[2]) - p.z};
}

// A convex solid lies below the plane that touches it at the point: its distance grows by at least `facing`,
// and ever faster. So does the torus's, where the point is on its hull.
static inline mask bulges(const struct placed *s, struct vec local) {
    COUNT(bulges, call);
    if (s->convex)
        return all_lanes();
    if (s->type == SHAPE_MANDELBULB)
        return no_lane();
    COUNT(bulges, hull);
    COUNT(bulges, scalar);
    return not_less(mul_add(local.x, local.x, local.z * local.z), set(s->a * s->a));
}

static inline real height_over(const struct placed *s, struct vec p) {
    return vec_dot(p, vec_set(s->normal)) - set(s->over);
}

// Above the plane, and rising over the cone's slope, or still above it where the ray leaves the bounds.
static inline mask plane_clears(real height, real slope, float q, const struct model *model) {
    real furthest = set(2.0f * (float)model->march.bounds_radius), zero = set(0.0f);
    mask rises =
        either(not_less(slope, set(q)), greater(mul_add(furthest, slope - set(q), height), zero));
    return both(greater(height, zero), rises);
}

#endif
