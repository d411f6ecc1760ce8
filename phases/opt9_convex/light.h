// Light at a packet's hits (B. T. Phong, "Illumination for computer generated pictures", CACM 18 (1975), as in shade.c):
// of any rays, and of camera rays for which the way from the camera to the light is known.
#ifndef OPT9_LIGHT_H
#define OPT9_LIGHT_H

#include "stage.h"

// a to the power of the shininess. One that is known and whole: products in place of a logarithm and an exponential.
static inline real shine_of(real a, real shininess) {
    if (!WHOLE_SHININESS)
        return power_of(a, shininess);
    real power = set(1.0f);
    for (int rest = WHOLE_SHININESS; rest; rest >>= 1, a = a * a)
        if (rest & 1)
            power = power * a;
    return power;
}

// shine: the cosine between the way back and the light's mirror image.
INLINE void bring_light(struct stage *at, const struct surface *surface, real shine, real reach,
                        const struct convex *work) {
    COUNT(bring_light, call);
    real specular = set(0.0f);
    const float *e = work->emission;
    mask shines = both(at->lit, greater(shine, surface->shine_from));
    if (any(shines)) {
        ACTIVE(count_of(shines));
        COUNT(bring_light, shines);
        specular =
            keep(shines, set(0.2f) * shine_of(most_of(shine, set(1e-30f)), surface->shininess));
    }
    struct vec base = surface->color;
    at->light = (struct vec){set(e[0]) * mul_add(base.x, at->facing, specular) * reach,
                             set(e[1]) * mul_add(base.y, at->facing, specular) * reach,
                             set(e[2]) * mul_add(base.z, at->facing, specular) * reach};
}

// axis: the plane's normal, which a kernel knows, where all hits are on it.
INLINE void stage_light(struct stage *at, const struct surface *surface, const float *axis,
                        const struct convex *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    const struct ray *ray = &at->ray;
    ACTIVE(count_of(at->hit.found));
    COUNT(stage_light, call);
    struct vec p = at->point, n = surface->normal, base = surface->color;
    real weight = ray->weight, zero = set(0.0f);
    if (model->features.fog) {
        COUNT(stage_light, fog);
        real far_sq = vec_dot(p, p);
        weight = weight * exp_of(set((float)-model->fog) * far_sq * root(far_sq));
    }
    at->weight = weight;
    at->color = vec_choose(at->hit.found, vec_scale(base, weight * set(0.01f)),
                           background(ray->weight, model)); // ambient
    const float *light = work->light;
    struct vec l = {set(light[0]) - p.x, set(light[1]) - p.y, set(light[2]) - p.z};
    real square = vec_dot(l, l), per = set(1.0f) / root(square);
    l = vec_scale(l, per);
    real facing = axis ? dot_with(axis, l) : vec_dot(n, l);
    at->lit = both(at->hit.found, both(greater(facing, zero), greater(square, zero)));
    at->facing = facing;
    at->to_light = l;
    real shine = vec_dot(axis ? reflected_at(axis, l) : vec_reflect(l, n), ray->direction);
    bring_light(at, surface, shine, weight * per, work);
}

// As stage_light(), of camera rays: the way to the light is told from the camera's, not of unit length.
INLINE void light_seen(struct stage *at, const struct surface *surface, const struct convex *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    ACTIVE(count_of(at->hit.found));
    COUNT(light_seen, call);
    struct vec d = at->ray.direction, n = surface->normal;
    real weight = set(1.0f), zero = set(0.0f), t = at->hit.t;
    if (model->features.fog) {
        COUNT(light_seen, fog);
        real far_sq = vec_dot(at->point, at->point);
        weight = exp_of(set((float)-model->fog) * far_sq * root(far_sq));
    }
    at->color = vec_choose(at->hit.found, vec_scale(surface->color, weight * set(0.01f)),
                           background(set(1.0f), model));
    const float *lamp = work->lamp;
    struct vec l = {neg_mul_add(d.x, t, set(lamp[0])), neg_mul_add(d.y, t, set(lamp[1])),
                    neg_mul_add(d.z, t, set(lamp[2]))};
    real square = vec_dot(l, l), per = set(1.0f) / root(square), along = vec_dot(n, l);
    real down = vec_dot(n, d), shine = neg_mul_add(along + along, down, vec_dot(l, d));
    along = negate_where(greater(down, zero), along); // n may be that of the other side
    at->facing = along * per;
    at->lit = both(at->hit.found, both(greater(along, zero), greater(square, zero)));
    bring_light(at, surface, shine * per, weight * per, work);
}

#endif
