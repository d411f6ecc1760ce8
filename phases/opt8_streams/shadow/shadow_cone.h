// Cones around shadow rays, and the bounds they give on a shape's distance along the ray: see PROOFS.md.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

// Whether a cone of slope q around a ray misses a sphere: |v − t·l| ≥ R + q·t for all t ≥ 0. The coefficients of the
// quadratic.
struct shadow_cone {
    vfloat c, b; // |v|² − R², v·l + q·R
};

static inline struct shadow_cone shadow_cone_to(struct vec v, struct vec l,
                                                const struct primitive *s) {
    return (struct shadow_cone){vec_dot(v, v) - v_splat(s->bound_sq),
                                vec_dot(v, l) + v_splat(s->slope_bound)};
}

static inline vmask cone_misses(struct shadow_cone cone, const struct primitive *s) {
    vfloat b = v_max(cone.b, v_splat(0.0f));
    return v_cmp_lt(b * b, v_splat(s->slope_a) * cone.c);
}

static inline struct vec to_centre(const struct primitive *s, struct vec p) {
    return vec_sub(vec_set(s->position), p);
}

#define INLINE static inline
#include "simd/flat_radius.h"

// Whether a shape's own shadow is known where the ray starts on it. A convex solid (a torus: on its hull) lies below
// its tangent plane, so its distance grows by at least `facing`. If that is too small, the first two steps of a march
// decide (self_shadow()), where the surface is flat enough.
static inline vmask convex_from(const struct primitive *s, struct vec local, vfloat facing,
                                const struct prepared *scene) {
    if (is_fractal(s->type) || s->eval == EVAL_FIELD)
        return v_mask_none();
    vmask may = v_mask_all();
    if (!s->convex)
        may = v_cmp_ge(v_madd(local.x, local.x, local.z * local.z), v_splat(s->a * s->a));
    vmask grazes = v_cmp_lt(facing, v_splat(scene->lit_slope));
    if (!v_any(grazes))
        return may;
    float short_of = FLAT_OFFSETS * (float)scene->model.march.surface_offset;
    return v_and(may, v_or(v_not(grazes), v_cmp_ge(flat_radius(local, s), v_splat(short_of))));
}

// Returns the distance above a plane.
static inline vfloat height_over(const struct primitive *s, struct vec p) {
    return vec_dot(p, vec_set(s->normal)) - v_splat(s->over);
}

// Whether the ray stays above the plane's cone: it rises faster than the cone's slope, or is still above where it
// leaves the bounds.
static inline vmask plane_clears(vfloat height, vfloat slope, float q, const struct model *model) {
    vfloat furthest = v_splat(2.0f * (float)model->march.bounds_radius), zero = v_splat(0.0f);
    vmask rises = v_or(v_cmp_ge(slope, v_splat(q)),
                       v_cmp_gt(v_madd(furthest, slope - v_splat(q), height), zero));
    return v_and(v_cmp_gt(height, zero), rises);
}
