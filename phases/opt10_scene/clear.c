// Shadow rays that need no march. The soft shadow is the paper's: the least of strength·√(h² − y²)/(t − y) over the
// steps of a march by the distance h to the whole scene, y = h²/(2·previous h). It depends on the steps, so a shape
// that only touches the march changes it; but of most rays it can be told without one. NOTES.md has the proofs.
#include "cone.h"

INLINE void clear_of(int i, struct vec point, struct vec local, struct vec to_light, real shape,
                     const struct prepared *scene, mask *clear) {
    if (!any(*clear))
        return;
    const struct placed *s = &scene->placed[i];
    mask here;
    if (s->way == LINEAR)
        here = either(same_shape(shape, i),
                      plane_clears(height_over(s, point), dot_with(s->normal, to_light),
                                   scene->lit_slope, scene));
    else {
        float slope = slope_to(s, scene->lit_slope);
        here = cone_misses(cone_to(to_centre(s, point), to_light, s, slope), slope);
        if (bits(but_not(here, *clear)))
            here = either(here, both(same_shape(shape, i), bulges(s, local)));
    }
    *clear = both(*clear, here);
}

mask cleared(struct vec point, struct vec local, struct vec to_light, real shape, mask active,
             const struct convex *work) {
    COUNT(cleared, call);
    mask clear = active;
    EACH_IN(work->desk->shading, clear_of, point, local, to_light, shape, KNOWN(work->scene),
            &clear);
    return clear;
}

// How fast the distance's slope grows at first, along l from a point with normal n: the surface's curvature.
INLINE real curvature(struct vec p, struct vec n, struct vec l, real facing,
                      const struct placed *s) {
    real zero = set(0.0f), tangent = neg_mul_add(facing, facing, set(1.0f));
    if (s->type == SHAPE_SPHERE)
        return tangent * set(1.0f / s->a);
    if (s->type != SHAPE_CONE && s->type != SHAPE_TORUS)
        return zero;
    real square = most_of(mul_add(p.x, p.x, p.z * p.z), set(1e-30f));
    real round = mul_sub(p.x, l.z, p.z * l.x); // times the radius: along the ring
    real ring = round * round * mul_add(n.x, p.x, n.z * p.z) / (square * square);
    if (s->type == SHAPE_CONE)
        return ring;
    return ring + most_of(tangent - round * round / square, zero) * set(1.0f / s->b);
}

real own_shadow(const struct placed *s, struct vec local, struct vec to_light, real facing,
                const struct prepared *scene) {
    COUNT(own_shadow, call);
    const struct limits *march = &scene->model.march;
    real one = set(1.0f), strength = set((float)KNOWN(scene)->model.shadow_strength);
    real t = set((float)KNOWN(scene)->model.march.surface_offset);
    real hit = set((float)march->hit_distance);
    real half = set(0.0f);
    if (s->way != LINEAR)
        half = set(0.5f) * curvature(local, normal_on(local, s), turned(s, to_light), facing, s);
    real u = most_of(mul_add(half, t, facing), set(1e-12f)), further = mul_add(t, u, t);
    real v = mul_add(half, further, facing), ratio = v * (one + u) / u;
    real inside = neg_mul_add(set(0.25f) * ratio, ratio, one);
    real term =
        strength * v * root(most_of(inside, set(0.0f))) / neg_mul_add(set(0.5f) * ratio, v, one);
    // A march that is within the hit distance at its first step has no term at all.
    mask first = not_less(u * t, hit), second = both(first, not_less(v * further, hit));
    if (march->max_steps < 2)
        second = no_lane();
    real least = choose(first, least_of(one, strength * u), one);
    return choose(second, least_of(least, term), least);
}

INLINE void block_by(int i, struct vec point, struct vec to_light, real distance,
                     const struct prepared *scene, mask *open) {
    if (!any(*open))
        return;
    const struct placed *s = &scene->placed[i];
    real t;
    mask met;
    if (s->way == LINEAR) {
        real slope = dot_with(s->normal, to_light), height = height_over(s, point);
        t = height / (set(0.0f) - slope);
        met = both(less(slope, set(0.0f)), greater(height, set(0.0f)));
    } else {
        struct vec at;
        met = enter(in_frame(s, point), turned(s, to_light), s, *open, &t, &at);
    }
    mask between =
        both(less(t, distance), greater(t, set((float)scene->model.march.surface_offset)));
    *open = but_not(both(met, between), *open);
}

mask reaches_light(struct vec point, struct vec to_light, real distance, mask active,
                   const struct convex *work) {
    COUNT(reaches_light, call);
    mask open = active;
    EACH_IN(work->desk->shading, block_by, point, to_light, distance, KNOWN(work->scene), &open);
    return open;
}
