// Tests that bound a shape's distance along a shadow ray: cones about the ray, planes, and convexity
// (PROOFS.md, 1. to 3.).
#pragma once

#include "hit/solids.h"
#include "shadow/shadow_rays.h"
#include "types/sdf.h"

// A cone of slope q about a ray of direction l; v: to the centre of a sphere of radius R. It meets the sphere
// where a·t² − 2·b·t + c ≤ 0, a = 1 − q². It misses the sphere if |v − t·l| ≥ R + q·t for all t ≥ 0.
struct shadow_cone {
    vfloat along, b, c; // v·l, v·l + q·R, |v|² − R²
};

INLINE struct shadow_cone cone_to_ball(struct vec v, struct vec l, float radius, float square,
                                       float q) {
    vfloat along = vec_dot(v, l);
    return (struct shadow_cone){along, along + v_splat(q * radius),
                                vec_dot(v, v) - v_splat(square)};
}

INLINE struct shadow_cone shadow_cone_to(struct vec v, struct vec l, const struct primitive *s,
                                         float q) {
    return cone_to_ball(v, l, s->bound, s->bound_sq, q);
}

INLINE vmask cone_misses(struct shadow_cone cone, float q) {
    vfloat b = v_max(cone.b, v_splat(0.0f));
    return v_cmp_lt(b * b, v_splat(1.0f - q * q) * cone.c);
}

// Returns where the cone leaves the sphere. Precondition: it meets the sphere. A cone of slope 1 or more
// never leaves it (strength 1 or less: a term may be below 1 anywhere).
INLINE vfloat cone_exit(struct shadow_cone cone, float q) {
    if (!(q < 1.0f))
        return v_splat(INFINITY);
    vfloat a = v_splat(1.0f - q * q > 1e-6f ? 1.0f - q * q : 1e-6f);
    vfloat discriminant = v_msub(cone.b, cone.b, a * cone.c);
    return (cone.b + v_sqrt(v_max(discriminant, v_splat(0.0f)))) / a;
}

// Returns the vector from p to the shape's position.
INLINE struct vec to_centre(const struct primitive *s, struct vec p) {
    return vec_sub(vec_set(s->position), p);
}

// Returns the support of a solid in direction n of its frame: the maximum of p·n over its points p. length:
// |n|. Torus: of its convex hull.
INLINE vfloat support_of(struct vec n, vfloat length, const struct primitive *s) {
    switch (s->type) {
    case SHAPE_BOX:
        return v_madd(v_splat(s->size[0]), v_abs(n.x),
                      v_madd(v_splat(s->size[1]), v_abs(n.y), v_splat(s->size[2]) * v_abs(n.z)));
    case SHAPE_ROUNDED_BOX:
        return v_madd(v_splat(s->size[0]), v_abs(n.x),
                      v_madd(v_splat(s->size[1]), v_abs(n.y),
                             v_madd(v_splat(s->size[2]), v_abs(n.z), v_splat(s->a) * length)));
    case SHAPE_OCTAHEDRON: return v_splat(s->a) * v_max(v_abs(n.x), v_max(v_abs(n.y), v_abs(n.z)));
    case SHAPE_CONE: {
        vfloat round = v_sqrt(v_madd(n.x, n.x, n.z * n.z)), up = v_splat(s->c) * n.y;
        return v_max(v_msub(v_splat(s->a), round, up), v_madd(v_splat(s->b), round, up));
    }
    default:
        return v_madd(v_splat(s->a), v_sqrt(v_madd(n.x, n.x, n.z * n.z)), v_splat(s->b) * length);
    }
}

// Returns the rays that leave, at slope q, a plane with the solid on its other side: then h(t) ≥ q·t
// (PROOFS.md, 2.). This clears flat or slim solids whose bounding sphere the cone meets. The plane tilts away
// from the solid's position, by a slope 2^-12 larger than q for rounding. If the ray passes through the
// position, `away` is rounding error; its length makes `height` too small then, so the test fails safely.
INLINE vmask plane_between(struct vec to, struct vec l, const struct primitive *s, float q) {
    float slope = q * (1 + 0x1p-12f);
    if (!(slope < 1))
        return v_mask_none();
    vfloat along = vec_dot(to, l);
    struct vec away = {v_msub(l.x, along, to.x), v_msub(l.y, along, to.y),
                       v_msub(l.z, along, to.z)};
    vfloat beside = v_sqrt(vec_dot(away, away));
    float upright = sqrtf(1 - slope * slope);
    struct vec n = vec_along(vec_scale(l, v_splat(slope) * beside), away, v_splat(upright));
    vfloat height = v_msub(v_splat(upright), beside, v_splat(slope) * along); // in lengths of n
    return v_cmp_gt((height - v_splat(1e-5f * s->bound)) * beside,
                    support_of(turned(s, n), beside, s));
}

// Returns the least ratio of a shape's distance to that to its bounding sphere, outside of that.
INLINE float share_of(const struct primitive *s) {
    return s->type == SHAPE_MANDELBULB ? BULB_SHARE : IS_GROUP(s) ? FIELD_OF(s)->share : 1.0f;
}

// Returns the slope of the cone that has to miss the sphere of shape s. It is 1 for what is no distance, a Mandelbulb's
// estimate or an intersection under a soft shadow: the proof for smaller slopes (PROOFS.md, 1.) does not hold.
INLINE float lit_slope_for(const struct primitive *s, float q) {
    float share = IS_GROUP(s) ? FIELD_OF(s)->lit_share : share_of(s);
    return s->type == SHAPE_MANDELBULB || !(q < share) ? 1.0f : q / share;
}

#include "simd/flat_radius.h"

// Returns the rays that their own shape s cannot darken after the second term (PROOFS.md, 3.). A convex solid
// lies below its tangent plane, so its distance grows by at least `facing` per unit of t. A torus behaves so
// on its hull. Rays that graze (facing below lit_slope) also need a surface that is flat over two steps.
INLINE vmask convex_from(const struct primitive *s, struct vec local, vfloat facing,
                         const struct known_scene *scene) {
    if (s->type == SHAPE_MANDELBULB || IS_GROUP(s))
        return v_mask_none();
    vmask may = v_mask_all();
    if (!s->convex) {
        vfloat square = v_madd(local.x, local.x, local.z * local.z);
        may = v_cmp_ge(square, v_splat(s->a * s->a));
    }
    vmask grazes = v_cmp_lt(facing, v_splat(scene->lit_slope));
    if (!v_any(grazes))
        return may;
    float short_of = FLAT_OFFSETS * (float)scene->model.march.surface_offset;
    return v_and(may, v_or(v_not(grazes), v_cmp_ge(flat_radius(local, s), v_splat(short_of))));
}

// Returns the rays that stay at q·t or more above a plane, within the bounds. height, slope: at t = 0.
INLINE vmask plane_clears(vfloat height, vfloat slope, float q, const struct known_scene *scene) {
    vfloat furthest = v_splat(2.0f * (float)scene->model.march.bounds_radius);
    return v_or(v_cmp_ge(slope, v_splat(q)),
                v_and(v_cmp_gt(height, v_splat(0.0f)),
                      v_cmp_gt(v_madd(furthest, slope - v_splat(q), height), v_splat(0.0f))));
}

// Returns the cosine at which rays enter the solid at `at`, or 0 near an edge, where it does not predict the
// last steps. With an edge at distance e, a step that starts outside the face ends e·sin/2 or more before it.
// So no step jumps from there to within the hit distance if e·sin·cos·(1 − cos)/2 is well above it; r->sharp
// has that bound.
INLINE vfloat entry_cosine(struct vec at, struct vec d, const struct primitive *s,
                           const struct shadow_rays *r) {
    vfloat cosine = v_splat(0.0f) - vec_dot(normal_on(at, s), d), fall = v_splat(1.0f) - cosine;
    vmask flat = v_cmp_ge(flat_radius(at, s) * cosine * (fall * fall), r->sharp);
    return v_select_or_zero(flat, cosine);
}
