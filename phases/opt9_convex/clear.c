// Shadow rays that need no march. The soft shadow is the paper's: the least of strength·√(h² − y²)/(t − y) over the
// steps of a march by the distance h to the whole scene, y = h²/(2·previous h). It depends on the steps, so a shape
// that only touches the march changes it; but of most rays it can be told without one. NOTES.md has
// the proofs.
#include "cells.h"

INLINE void clear_of(int i, struct vec point, struct vec local, struct vec to_light, real facing,
                     real shape, const struct convex *work, mask *clear) {
    if (!any(*clear))
        return;
    const struct known *scene = KNOWN(work->scene);
    const struct placed *s = &scene->placed[i];
    float q = scene->lit_slope;
    mask here;
    if (s->way == LINEAR) {
        COUNT(cleared, plane);
        COUNT(cleared, plane_scalar);
        here = either(same_shape(shape, i),
                      plane_clears(height_over(s, point), dot_with(s->normal, to_light), q, scene));
    } else {
        COUNT(cleared, solid);
        COUNT(cleared, solid_scalar);
        float slope = slope_to(s, q);
        struct vec to = to_centre(s, point);
        here = cone_misses(cone_to(to, to_light, s, slope), slope);
        if (s->type != SHAPE_SPHERE && s->type != SHAPE_MANDELBULB && any(but_not(here, *clear)))
            here = either(here, plane_between(to, to_light, s, q));
        if (any(but_not(here, *clear))) {
            COUNT(cleared, own);
            here = either(here, both(same_shape(shape, i), bulges(s, local, facing, scene)));
        }
    }
    *clear = both(*clear, here);
}

mask cleared(const struct vec *point, const struct vec *local, const struct vec *to_light,
             real facing, real shape, mask active, const struct convex *work) {
    ACTIVE(count_of(active));
    COUNT(cleared, call);
    mask clear = REPEATS(work->scene) ? no_lane() : active; // there may be a copy anywhere
    EACH_IN(work->desk->shading, clear_of, *point, *local, *to_light, facing, shape, work, &clear);
    return clear;
}

// How fast the distance's slope grows at first, along l from a point with normal n: the surface's curvature.
INLINE real curvature(struct vec p, struct vec n, struct vec l, real facing,
                      const struct placed *s) {
    COUNT(curvature, call);
    real zero = set(0.0f), tangent = neg_mul_add(facing, facing, set(1.0f));
    if (s->type == SHAPE_SPHERE) {
        COUNT(curvature, sphere);
        COUNT(curvature, sphere_scalar);
        return tangent * set(1.0f / s->a);
    }
    if (s->type != SHAPE_CONE && s->type != SHAPE_TORUS)
        return zero;
    COUNT(curvature, ring);
    real square = most_of(mul_add(p.x, p.x, p.z * p.z), set(1e-30f));
    real round = mul_sub(p.x, l.z, p.z * l.x); // times the radius: along the ring
    real ring = round * round * mul_add(n.x, p.x, n.z * p.z) / (square * square);
    if (s->type == SHAPE_CONE)
        return ring;
    COUNT(curvature, torus);
    COUNT(curvature, torus_scalar);
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
    if (s->way != LINEAR) {
        COUNT(own_shadow, curved);
        half = set(0.5f) * curvature(local, normal_on(local, s), turned(s, to_light), facing, s);
    }
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

// From where a march would begin to the light, or to the bounds.
struct way_out {
    struct vec point, start, local, to_light;
    real shape, way, reach; // reach: a light may be in a shape by less than float tells
};

INLINE void block_by(int i, const struct way_out *w, const struct convex *work, mask *open) {
    if (!any(*open))
        return;
    const struct known *scene = KNOWN(work->scene);
    const struct placed *s = &scene->placed[i];
    COUNT(reaches_light, shape);
    real zero = set(0.0f), offset = set((float)scene->model.march.surface_offset);
    mask own = same_shape(w->shape, i), blocked;
    if (s->way == LINEAR) {
        COUNT(reaches_light, plane);
        real slope = dot_with(s->normal, w->to_light), height = height_over(s, w->start);
        blocked = but_not(own, less(mul_add(w->way, slope, height), zero));
        blocked = either(blocked, but_not(own, less(height, zero)));
    } else if (REPEATED(s)) {
        COUNT(reaches_light, repeated);
        struct vec from = vec_along(w->local, turned(s, w->to_light), offset);
        from = vec_choose(own, from, in_frame(s, w->start));
        blocked = cells_block(s, from, w->to_light, own, *open, w->reach);
    } else {
        COUNT(reaches_light, solid);
        struct vec at, d = turned(s, w->to_light),
                       o = vec_choose(own, vec_along(w->local, d, offset), in_frame(s, w->start));
        mask asked = s->convex ? but_not(own, *open) : *open;
        real t;
        mask within;
        blocked = enter(o, d, s, asked, &t, &at, &within);
        blocked = both(blocked, less(t, w->reach));
        if (!s->convex) {
            COUNT(reaches_light, torus);
            within = both(asked, less(vec_dot(o, o), set(s->bound_sq)));
        }
        if (any(within)) {
            COUNT(reaches_light, within);
            blocked = either(blocked, both(within, less(distance_at(o, s, no_lane()), zero)));
        }
    }
    *open = but_not(both(blocked, greater(w->way, zero)), *open);
}

mask reaches_light(struct vec point, struct vec local, struct vec to_light, real shape,
                   real distance, mask active, const struct convex *work) {
    ACTIVE(count_of(active));
    COUNT(reaches_light, call);
    COUNT(reaches_light, scalar);
    const struct known_model *model = &KNOWN(work->scene)->model;
    real zero = set(0.0f), offset = set((float)model->march.surface_offset),
         hit = set((float)work->scene->model.march.hit_distance);
    float radius = (float)model->march.bounds_radius;
    struct vec start = vec_along(point, to_light, offset);
    real along = vec_dot(start, to_light);
    real leaves =
        root(most_of(mul_add(along, along, set(radius * radius) - vec_dot(start, start)), zero));
    real way = least_of(distance - offset, leaves - along);
    real reach = mul_add(way, set(1.0f + 0x1p-21f), hit);
    struct way_out w = {point, start, local, to_light, shape, way, reach};
    mask open = active;
    EACH_IN(work->desk->shading, block_by, &w, work, &open);
    return open;
}
