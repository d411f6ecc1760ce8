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

// Beyond this many surface_offsets a surface is what its normal and curvature say for two steps of a shadow's march:
// its radius of curvature, by 32²/2 to 0.05 %; the nearest edge by SHARP less of them, for those steps are no longer
// than 1.4.
#define FLAT 32.0f
#define SHARP 16.0f

// The least of both, an edge's distance times SHARP, of a point on the surface.
static inline real flat_within(struct vec p, const struct placed *s) {
    COUNT(flat_within, call);
    switch (s->type) {
    case SHAPE_SPHERE: return set(s->a);
    case SHAPE_BOX: { // the least of three is 0 here, the second is how far the next face is
        COUNT(flat_within, box);
        real x = absolute(absolute(p.x) - set(s->size[0]));
        real y = absolute(absolute(p.y) - set(s->size[1]));
        real z = absolute(absolute(p.z) - set(s->size[2]));
        return set(SHARP) * most_of(least_of(x, y), least_of(most_of(x, y), z));
    }
    case SHAPE_ROUNDED_BOX: return set(0.0f); // flat here, round there: march
    case SHAPE_OCTAHEDRON:                    // an edge is where a coordinate is 0
        COUNT(flat_within, octahedron);
        return set(SHARP) * least_of(absolute(p.x), least_of(absolute(p.y), absolute(p.z)));
    case SHAPE_CONE: {
        COUNT(flat_within, cone);
        COUNT(flat_within, cone_scalar);
        real radius = root(mul_add(p.x, p.x, p.z * p.z));
        real below = most_of(absolute(radius - set(s->a)), absolute(p.y + set(s->c)));
        real above = most_of(absolute(radius - set(s->b)), absolute(p.y - set(s->c)));
        mask cap = less(absolute(absolute(p.y) - set(s->c)), set(1e-5f * s->c));
        return least_of(set(SHARP) * least_of(below, above), choose(cap, set(INFINITY), radius));
    }
    default: return set(s->b);
    }
}

// A convex solid lies below the plane that touches it at the point: its distance grows by at least `facing`,
// and ever faster. So does the torus's, where the point is on its hull. Where that is too little to be lit, the
// first two steps of a march tell the shadow (clear.c), if they are short beside what the shape curves by.
static inline mask bulges(const struct placed *s, struct vec local, real facing,
                          const struct prepared *scene) {
    COUNT(bulges, call);
    if (s->type == SHAPE_MANDELBULB)
        return no_lane();
    COUNT(bulges, solid);
    mask may = all_lanes();
    if (!s->convex) {
        COUNT(bulges, hull);
        COUNT(bulges, hull_scalar);
        may = not_less(mul_add(local.x, local.x, local.z * local.z), set(s->a * s->a));
    }
    mask grazes = less(facing, set(scene->lit_slope));
    if (!any(grazes))
        return may;
    COUNT(bulges, grazes);
    COUNT(bulges, grazes_scalar);
    float short_of = FLAT * (float)scene->model.march.surface_offset;
    return both(may, either(not_in(grazes), not_less(flat_within(local, s), set(short_of))));
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
