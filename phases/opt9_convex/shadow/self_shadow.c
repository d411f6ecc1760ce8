// The shadow of a ray's own shape, without a march. The soft shadow is the paper's: the least term
// strength·√(h² − y²)/(t − y) over the steps of a march by the distance h to the scene, with y = h²/(2·previous h). Of
// its own convex shape a ray meets it in the first two terms (PROOFS.md, 3.).
#include "hit/solids.h"
#include "shadow/shadow_rays.h"
#include "types/sdf.h"

// Returns the surface's curvature in direction l at a point with normal n: how fast the slope of the distance
// grows.
INLINE vfloat curvature(struct vec p, struct vec n, struct vec l, vfloat facing,
                        const struct primitive *s) {
    vfloat zero = v_splat(0.0f), tangent = v_nmadd(facing, facing, v_splat(1.0f));
    if (s->type == SHAPE_SPHERE)
        return tangent * v_splat(1.0f / s->a);
    if (s->type != SHAPE_CONE && s->type != SHAPE_TORUS)
        return zero;
    vfloat square = v_max(v_madd(p.x, p.x, p.z * p.z), v_splat(1e-30f));
    vfloat round = v_msub(p.x, l.z, p.z * l.x); // radius times the component along the ring
    vfloat ring = round * round * v_madd(n.x, p.x, n.z * p.z) / (square * square);
    if (s->type == SHAPE_CONE)
        return ring;
    return ring + v_max(tangent - round * round / square, zero) * v_splat(1.0f / s->b);
}

vfloat self_shadow(const struct primitive *s, struct vec local, struct vec to_light, vfloat facing,
                   const struct prepared *scene) {
    const struct limits *march = &scene->model.march;
    vfloat one = v_splat(1.0f), strength = v_splat((float)KNOWN(scene)->model.shadow_strength);
    vfloat t = v_splat((float)KNOWN(scene)->model.march.surface_offset);
    vfloat hit = v_splat((float)march->hit_distance);
    vfloat half = v_splat(0.0f);
    if (s->eval != EVAL_LINEAR) {
        half =
            v_splat(0.5f) * curvature(local, normal_on(local, s), turned(s, to_light), facing, s);
    }
    vfloat u = v_max(v_madd(half, t, facing), v_splat(1e-12f)), further = v_madd(t, u, t);
    vfloat v = v_madd(half, further, facing), ratio = v * (one + u) / u;
    vfloat inside = v_nmadd(v_splat(0.25f) * ratio, ratio, one);
    vfloat ahead = v_nmadd(v_splat(0.5f) * ratio, v, one);
    vfloat term = strength * v * v_sqrt(inside) / ahead;
    // A march that starts within the hit distance ends at once, without a term. A ray that leaves along the normal has
    // no second one: it is 0/0.
    vmask first = v_cmp_ge(u * t, hit), second = v_and(first, v_cmp_ge(v * further, hit));
    second = v_and(second, v_cmp_gt(v_min(inside, ahead), v_splat(0.0f)));
    if (march->max_steps < 2)
        second = v_mask_none();
    vfloat least = v_select(first, v_min(one, strength * u), one);
    return v_select(second, v_min(least, term), least);
}
