// Cones about shadow rays, and what they say of a shape's distance along the ray.
#ifndef OPT9_CONE_H
#define OPT9_CONE_H

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

// Where those that meet it have left it. Of slope 1 or more none does: with a strength of 1 or less a term may come below 1
// anywhere.
INLINE real cone_leaves(struct cone c, float q) {
    COUNT(cone_leaves, call);
    if (!(q < 1.0f))
        return set(INFINITY);
    COUNT(cone_leaves, narrow);
    COUNT(cone_leaves, scalar);
    real wide = set(1.0f - q * q > 1e-6f ? 1.0f - q * q : 1e-6f);
    real square = mul_sub(c.lean, c.lean, wide * c.need);
    return (c.lean + root(most_of(square, set(0.0f)))) / wide;
}

INLINE struct vec to_centre(const struct placed *s, struct vec p) {
    return (struct vec){set(s->position[0]) - p.x, set(s->position[1]) - p.y,
                        set(s->position[2]) - p.z};
}

// How far a solid reaches in the direction n of its frame: no point p of it has a product p·n above. Of a torus its hull.
INLINE real reach_of(struct vec n, real length, const struct placed *s) {
    COUNT(reach_of, call);
    switch (s->type) {
    case SHAPE_BOX:
        COUNT(reach_of, box);
        return mul_add(set(s->size[0]), absolute(n.x),
                       mul_add(set(s->size[1]), absolute(n.y), set(s->size[2]) * absolute(n.z)));
    case SHAPE_ROUNDED_BOX:
        COUNT(reach_of, rounded);
        return mul_add(set(s->size[0]), absolute(n.x),
                       mul_add(set(s->size[1]), absolute(n.y),
                               mul_add(set(s->size[2]), absolute(n.z), set(s->a) * length)));
    case SHAPE_OCTAHEDRON:
        COUNT(reach_of, octahedron);
        return set(s->a) * most_of(absolute(n.x), most_of(absolute(n.y), absolute(n.z)));
    case SHAPE_CONE: {
        COUNT(reach_of, cone);
        real round = root(mul_add(n.x, n.x, n.z * n.z)), up = set(s->c) * n.y;
        return most_of(mul_sub(set(s->a), round, up), mul_add(set(s->b), round, up));
    }
    default:
        COUNT(reach_of, torus);
        return mul_add(set(s->a), root(mul_add(n.x, n.x, n.z * n.z)), set(s->b) * length);
    }
}

// Rays that leave a plane at slope q on whose other side the solid is: h(t) ≥ q·t too, and what lies flat, or is
// slim, is told by it where its bounding sphere is in the way. The plane leans away from the solid's position, and by 2^-12
// more than q: so much for rounding. Of a ray through the position `away` is all rounding, and leans anywhere: the position's
// height over the plane is told by how long it is alone, −to·away = away², which is too little then.
INLINE mask plane_between(struct vec to, struct vec l, const struct placed *s, float q) {
    COUNT(plane_between, call);
    COUNT(plane_between, scalar);
    float lean = q * (1 + 0x1p-12f);
    if (!(lean < 1))
        return no_lane();
    real along = vec_dot(to, l);
    struct vec away = {mul_sub(l.x, along, to.x), mul_sub(l.y, along, to.y),
                       mul_sub(l.z, along, to.z)};
    real beside = root(vec_dot(away, away));
    float upright = sqrtf(1 - lean * lean);
    struct vec n = vec_along(vec_scale(l, set(lean) * beside), away, set(upright));
    real height = mul_sub(set(upright), beside, set(lean) * along); // in lengths of n
    return greater((height - set(1e-5f * s->bound)) * beside, reach_of(turned(s, n), beside, s));
}

// The slope that the cone to a shape needs. None clears a Mandelbulb: its estimate is less than the distance, so that h may
// grow by more than a step's length, or to nearly 2·previous with no surface where the proof (NOTES.md, 1.)
// has one.
INLINE float slope_to(const struct placed *s, float q) {
    return s->type == SHAPE_MANDELBULB ? 1.0f : q;
}

// Beyond this many surface_offsets a surface is what its normal and curvature say for two steps of a shadow's march:
// its radius of curvature, by 32²/2 to 0.05 %; the nearest edge by SHARP less of them, for those steps are no longer
// than 1.4.
#define FLAT 32.0f
#define SHARP 16.0f

// The least of both, an edge's distance times SHARP, of a point on the surface.
INLINE real flat_within(struct vec p, const struct placed *s) {
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
INLINE mask bulges(const struct placed *s, struct vec local, real facing,
                   const struct known *scene) {
    COUNT(bulges, call);
    if (s->type == SHAPE_MANDELBULB)
        return no_lane();
    COUNT(bulges, solid);
    mask may = all_lanes();
    if (!s->convex) {
        COUNT(bulges, torus);
        COUNT(bulges, torus_scalar);
        real square = mul_add(local.x, local.x, local.z * local.z);
        may = not_less(square, set(s->a * s->a));
    }
    mask grazes = less(facing, set(scene->lit_slope));
    if (!any(grazes))
        return may;
    COUNT(bulges, grazes);
    COUNT(bulges, grazes_scalar);
    float short_of = FLAT * (float)scene->model.march.surface_offset;
    return both(may, either(not_in(grazes), not_less(flat_within(local, s), set(short_of))));
}

INLINE mask plane_clears(real height, real slope, float q, const struct known *scene) {
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
    bool floor;         // all are from one
    real first, cosine; // the first entry into a solid, of those that can be met; 0: not told
    real sharp;         // see slant_at()
    mask some, many;    // of rays from a plane: one shape can be met; not one convex one alone
};

// The cosine at which rays enter a solid at a point; 0 where that says nothing of the steps before: an edge at distance e makes
// them fall faster, to the surface itself if a ray goes to it. From outside of the face about the point a step ends
// e·sin/2 before it or more, so that none goes from there to within the hit distance if e·sin·cos·(1 − cos)/2 is well above that.
INLINE real slant_at(struct vec at, struct vec d, const struct placed *s, const struct rays *r) {
    COUNT(slant_at, call);
    real cosine = set(0.0f) - vec_dot(normal_on(at, s), d), rest = set(1.0f) - cosine;
    mask flat = not_less(flat_within(at, s) * cosine * (rest * rest), r->sharp);
    return keep(flat, cosine);
}

KNOWN_SHARED void look_at_plane(const struct placed *s, int i, struct rays *r,
                                const struct convex *work, struct near *near);
// Where the rays `met` enter a solid that they are not from, and at what slant, if it is the first.
KNOWN_SHARED void enter_on_the_way(const struct placed *s, int i, struct rays *r, mask met);
// A shape's own view of the rays.
KNOWN_SHARED void see_along(const struct rays *r, int i, struct near *near,
                            const struct convex *work);
// The shapes that can be the nearest somewhere before the rays' end, with their own view of the rays.
SHARED void choose_shapes(struct rays *r, struct near *nears, struct shapes *casters,
                          const struct convex *work);

#endif
