// Cones about shadow rays, and what they say of a shape's distance along the ray.
#ifndef OPT9_SHADOW_CONE_H
#define OPT9_SHADOW_CONE_H

#include "core/sdf.h"
#include "hit/solids.h"
#include "shadow/shadow_rays.h"

// Cones of slope q about the ray that miss a sphere: |v − t·l| ≥ R + q·t for all t ≥ 0.
struct shadow_cone {
    vfloat along, need, lean; // v·l, |v|² − R², v·l + q·R
};

INLINE struct shadow_cone shadow_cone_to(struct vec v, struct vec l, const struct primitive *s,
                                         float q) {
    vfloat along = vec_dot(v, l);
    return (struct shadow_cone){along, vec_dot(v, v) - v_splat(s->bound_sq),
                                along + v_splat(q * s->bound)};
}

INLINE vmask cone_misses(struct shadow_cone c, float q) {
    vfloat lean = v_max(c.lean, v_splat(0.0f));
    return v_cmp_lt(lean * lean, v_splat(1.0f - q * q) * c.need);
}

// Where those that meet it have left it. Of slope 1 or more none does: with a strength of 1 or less a term may come below 1
// anywhere.
INLINE vfloat cone_exit(struct shadow_cone c, float q) {
    COUNT(cone_exit, call);
    if (!(q < 1.0f))
        return v_splat(INFINITY);
    COUNT(cone_exit, narrow);
    COUNT(cone_exit, scalar);
    vfloat wide = v_splat(1.0f - q * q > 1e-6f ? 1.0f - q * q : 1e-6f);
    vfloat square = v_msub(c.lean, c.lean, wide * c.need);
    return (c.lean + v_sqrt(v_max(square, v_splat(0.0f)))) / wide;
}

INLINE struct vec to_centre(const struct primitive *s, struct vec p) {
    return (struct vec){v_splat(s->position[0]) - p.x, v_splat(s->position[1]) - p.y,
                        v_splat(s->position[2]) - p.z};
}

// How far a solid reaches in the direction n of its frame: no point p of it has a product p·n above. Of a torus its hull.
INLINE vfloat support_of(struct vec n, vfloat length, const struct primitive *s) {
    COUNT(support_of, call);
    switch (s->type) {
    case SHAPE_BOX:
        COUNT(support_of, box);
        return v_madd(v_splat(s->size[0]), v_abs(n.x),
                      v_madd(v_splat(s->size[1]), v_abs(n.y), v_splat(s->size[2]) * v_abs(n.z)));
    case SHAPE_ROUNDED_BOX:
        COUNT(support_of, rounded);
        return v_madd(v_splat(s->size[0]), v_abs(n.x),
                      v_madd(v_splat(s->size[1]), v_abs(n.y),
                             v_madd(v_splat(s->size[2]), v_abs(n.z), v_splat(s->a) * length)));
    case SHAPE_OCTAHEDRON:
        COUNT(support_of, octahedron);
        return v_splat(s->a) * v_max(v_abs(n.x), v_max(v_abs(n.y), v_abs(n.z)));
    case SHAPE_CONE: {
        COUNT(support_of, cone);
        vfloat round = v_sqrt(v_madd(n.x, n.x, n.z * n.z)), up = v_splat(s->c) * n.y;
        return v_max(v_msub(v_splat(s->a), round, up), v_madd(v_splat(s->b), round, up));
    }
    default:
        COUNT(support_of, torus);
        return v_madd(v_splat(s->a), v_sqrt(v_madd(n.x, n.x, n.z * n.z)), v_splat(s->b) * length);
    }
}

// Rays that leave a plane at slope q on whose other side the solid is: h(t) ≥ q·t too, and what lies flat, or is
// slim, is told by it where its bounding sphere is in the way. The plane leans away from the solid's position, and by 2^-12
// more than q: so much for rounding. Of a ray through the position `away` is all rounding, and leans anywhere: the position's
// height over the plane is told by how long it is alone, −to·away = away², which is too little then.
INLINE vmask plane_between(struct vec to, struct vec l, const struct primitive *s, float q) {
    COUNT(plane_between, call);
    COUNT(plane_between, scalar);
    float lean = q * (1 + 0x1p-12f);
    if (!(lean < 1))
        return v_mask_none();
    vfloat along = vec_dot(to, l);
    struct vec away = {v_msub(l.x, along, to.x), v_msub(l.y, along, to.y),
                       v_msub(l.z, along, to.z)};
    vfloat beside = v_sqrt(vec_dot(away, away));
    float upright = sqrtf(1 - lean * lean);
    struct vec n = vec_along(vec_scale(l, v_splat(lean) * beside), away, v_splat(upright));
    vfloat height = v_msub(v_splat(upright), beside, v_splat(lean) * along); // in lengths of n
    return v_cmp_gt((height - v_splat(1e-5f * s->bound)) * beside,
                    support_of(turned(s, n), beside, s));
}

// The slope that the cone to a shape needs. None clears a Mandelbulb: its estimate is less than the distance, so that h may
// grow by more than a step's length, or to nearly 2·previous with no surface where the proof (PROOFS.md, 1.)
// has one.
INLINE float lit_slope_for(const struct primitive *s, float q) {
    return s->type == SHAPE_MANDELBULB ? 1.0f : q;
}

// Beyond this many surface_offsets a surface is what its normal and curvature say for two steps of a shadow's march:
// its radius of curvature, by 32²/2 to 0.05 %; the nearest edge by EDGE_FACTOR less of them, for those steps are no longer
// than 1.4.
#define FLAT_OFFSETS 32.0f

#define EDGE_FACTOR 16.0f

// The least of both, an edge's distance times EDGE_FACTOR, of a point on the surface.
INLINE vfloat flat_radius(struct vec p, const struct primitive *s) {
    COUNT(flat_radius, call);
    switch (s->type) {
    case SHAPE_SPHERE: return v_splat(s->a);
    case SHAPE_BOX: { // the least of three is 0 here, the second is how far the next face is
        COUNT(flat_radius, box);
        vfloat x = v_abs(v_abs(p.x) - v_splat(s->size[0]));
        vfloat y = v_abs(v_abs(p.y) - v_splat(s->size[1]));
        vfloat z = v_abs(v_abs(p.z) - v_splat(s->size[2]));
        return v_splat(EDGE_FACTOR) * v_max(v_min(x, y), v_min(v_max(x, y), z));
    }
    case SHAPE_ROUNDED_BOX: return v_splat(0.0f); // flat here, round there: march
    case SHAPE_OCTAHEDRON:                        // an edge is where a coordinate is 0
        COUNT(flat_radius, octahedron);
        return v_splat(EDGE_FACTOR) * v_min(v_abs(p.x), v_min(v_abs(p.y), v_abs(p.z)));
    case SHAPE_CONE: {
        COUNT(flat_radius, cone);
        COUNT(flat_radius, cone_scalar);
        vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
        vfloat below = v_max(v_abs(radius - v_splat(s->a)), v_abs(p.y + v_splat(s->c)));
        vfloat above = v_max(v_abs(radius - v_splat(s->b)), v_abs(p.y - v_splat(s->c)));
        vmask cap = v_cmp_lt(v_abs(v_abs(p.y) - v_splat(s->c)), v_splat(1e-5f * s->c));
        return v_min(v_splat(EDGE_FACTOR) * v_min(below, above),
                     v_select(cap, v_splat(INFINITY), radius));
    }
    default: return v_splat(s->b);
    }
}

// A convex solid lies below the plane that touches it at the point: its distance grows by at least `facing`,
// and ever faster. So does the torus's, where the point is on its hull. Where that is too little to be lit, the
// first two steps of a march tell the shadow (shadow/shadow_cull.c), if they are short beside what the shape curves by.
INLINE vmask convex_from(const struct primitive *s, struct vec local, vfloat facing,
                         const struct known_scene *scene) {
    COUNT(convex_from, call);
    if (s->type == SHAPE_MANDELBULB)
        return v_mask_none();
    COUNT(convex_from, solid);
    vmask may = v_mask_all();
    if (!s->convex) {
        COUNT(convex_from, torus);
        COUNT(convex_from, torus_scalar);
        vfloat square = v_madd(local.x, local.x, local.z * local.z);
        may = v_cmp_ge(square, v_splat(s->a * s->a));
    }
    vmask grazes = v_cmp_lt(facing, v_splat(scene->lit_slope));
    if (!v_any(grazes))
        return may;
    COUNT(convex_from, grazes);
    COUNT(convex_from, grazes_scalar);
    float short_of = FLAT_OFFSETS * (float)scene->model.march.surface_offset;
    return v_and(may, v_or(v_not(grazes), v_cmp_ge(flat_radius(local, s), v_splat(short_of))));
}

INLINE vmask plane_clears(vfloat height, vfloat slope, float q, const struct known_scene *scene) {
    vfloat furthest = v_splat(2.0f * (float)scene->model.march.bounds_radius);
    return v_or(v_cmp_ge(slope, v_splat(q)),
                v_and(v_cmp_gt(height, v_splat(0.0f)),
                      v_cmp_gt(v_madd(furthest, slope - v_splat(q), height), v_splat(0.0f))));
}

// The cosine at which rays enter a solid at a point; 0 where that says nothing of the steps before: an edge at distance e makes
// them fall faster, to the surface itself if a ray goes to it. From outside of the face about the point a step ends
// e·sin/2 before it or more, so that none goes from there to within the hit distance if e·sin·cos·(1 − cos)/2 is well above that.
INLINE vfloat entry_cosine(struct vec at, struct vec d, const struct primitive *s,
                           const struct shadow_rays *r) {
    COUNT(entry_cosine, call);
    vfloat cosine = v_splat(0.0f) - vec_dot(normal_on(at, s), d), rest = v_splat(1.0f) - cosine;
    vmask flat = v_cmp_ge(flat_radius(at, s) * cosine * (rest * rest), r->sharp);
    return v_select_or_zero(flat, cosine);
}

#endif
