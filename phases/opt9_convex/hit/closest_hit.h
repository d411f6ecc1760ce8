// What camera and mirror rays meet of solids, planes and copies, by closed forms.
#ifndef OPT9_MEET_H
#define OPT9_MEET_H

#include "bvh/bvh_lists.h"
#include "core/worker_scratch.h"
#include "repetition/repeated_rays.h"

INLINE void take_hit(vmask met, vfloat t, struct vec local, const struct primitive *s,
                     struct surface_hit *hit) {
    if (!v_any(met))
        return;
    hit->found = v_or(hit->found, met);
    hit->t = v_select(met, t, hit->t);
    hit->shape = v_select(met, v_splat(s->index), hit->shape);
    hit->local = vec_select(met, local, hit->local);
}

// Part by part, as rays and hits are below: a mask that was just written, copied as a part of a whole register, is waited
// for.
static inline void no_hit(struct surface_hit *hit) {
    hit->found = v_mask_none();
    hit->t = v_splat(INFINITY);
    hit->shape = v_splat(-1.0f);
    hit->local = (struct vec){v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
}

// Camera rays. Where the camera is inside of a shape, fallback/march.c has the frame.
INLINE void meet(int i, struct vec direction, vmask active, const struct local_camera *eyes,
                 const struct prepared *scene, struct surface_hit *hit) {
    COUNT(meet, call);
    const struct primitive *s = &KNOWN(scene)->placed[i];
    vfloat t;
    vmask met;
    struct vec local;
    if (s->type == SHAPE_MANDELBULB || REPEATED(s)) // by hit_bulbs(), hit_repeated()
        return;
    ACTIVE(v_count(active));
    if (s->way == EVAL_LINEAR) {
        COUNT(meet, plane);
        vfloat slope = add_dot(s->normal, direction);
        t = v_splat(eyes[i].height) / (v_splat(0.0f) - slope);
        met = v_and(active, v_cmp_lt(slope, v_splat(0.0f))); // the camera is above it
        local = hit->local;
    } else {
        COUNT(meet, solid);
        vmask behind;
        met = enter(vec_set(eyes[i].at), turned(s, direction), s, active, &t, &local, &behind);
    }
    take_hit(v_and(met, v_cmp_lt(t, hit->t)), t, local, s, hit);
}

// Mirror rays start off a surface by surface_offset: in a crevice, inside of another solid. Like a march they
// then hit it at once, at the distance that they are at, which is negative.
INLINE vmask hit_from_surface(struct vec o, struct vec d, const struct primitive *s, vmask active,
                              vmask own, vfloat *t, struct vec *local) {
    COUNT(hit_from_surface, call);
    if (s->convex)
        active = v_andnot(own, active); // what it leaves, it does not meet again
    vmask within, met = enter(o, d, s, active, t, local, &within);
    if (!s->convex) {
        COUNT(hit_from_surface, torus);
        within = v_and(v_andnot(own, active), v_cmp_lt(vec_dot(o, o), v_splat(s->bound_sq)));
    }
    if (!v_any(within))
        return met;
    COUNT(hit_from_surface, within);
    vfloat h = distance_at(o, s, v_mask_none());
    vmask inside = v_and(within, v_cmp_lt(h, v_splat(0.0f)));
    *t = v_select(inside, h, *t);
    *local = vec_select(inside, vec_along(o, d, h), *local);
    return v_or(met, inside);
}

INLINE void meet_mirror(int i, const struct packet_ray *ray, const struct prepared *scene,
                        struct surface_hit *hit) {
    const struct primitive *s = &KNOWN(scene)->placed[i];
    ACTIVE(v_count(ray->active));
    vmask own = is_shape(ray->leaves, i), met;
    vfloat t;
    struct vec local = hit->local;
    if (s->type == SHAPE_MANDELBULB) // by hit_bulbs()
        return;
    COUNT(closest_mirror_hit, shape);
    if (s->way == EVAL_LINEAR) {
        COUNT(closest_mirror_hit, plane);
        vfloat slope = add_dot(s->normal, ray->direction), height = height_over(s, ray->origin);
        vmask under = v_cmp_lt(height, v_splat(0.0f));
        t = v_select(under, height, height / (v_splat(0.0f) - slope));
        met = v_and(v_andnot(own, ray->active), v_or(under, v_cmp_lt(slope, v_splat(0.0f))));
    } else if (REPEATED(s)) {
        COUNT(closest_mirror_hit, repeated);
        vfloat end =
            v_min(bounds_distance(ray->origin, ray->direction, &scene->model.march), hit->t);
        met = hit_cells(ray, s, own, end, (float)scene->model.march.surface_offset, &t, &local);
    } else {
        COUNT(closest_mirror_hit, solid);
        met = hit_from_surface(to_local(s, ray->origin), turned(s, ray->direction), s, ray->active,
                               own, &t, &local);
    }
    take_hit(v_and(met, v_cmp_lt(t, hit->t)), t, local, s, hit);
}

static struct surface_hit closest_mirror_hit(const struct packet_ray *ray,
                                             const struct tile_context *work) {
    COUNT(closest_mirror_hit, call);
    struct surface_hit hit;
    no_hit(&hit);
    if (HAS_BVH(work->scene)) {
        int *list = work->scratch->mirror_list;
        int count = bvh_list_along(ray->origin, ray->direction, ray->active, work, list);
        for (int k = 0; k < count; k++)
            meet_mirror(list[k], ray, work->scene, &hit);
    } else
        EACH_SHAPE(work->scene, meet_mirror, ray, work->scene, &hit);
    return hit;
}

#endif
