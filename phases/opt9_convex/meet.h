// What camera and mirror rays meet of solids, planes and copies, by closed forms.
#ifndef OPT9_MEET_H
#define OPT9_MEET_H

#include "cells.h"
#include "crowd.h"
#include "desk.h"

INLINE void take(vmask met, vfloat t, struct vec local, const struct placed *s, struct found *hit) {
    if (!v_any(met))
        return;
    hit->found = v_or(hit->found, met);
    hit->t = v_select(met, t, hit->t);
    hit->shape = v_select(met, v_splat(s->index), hit->shape);
    hit->local = vec_select(met, local, hit->local);
}

// Part by part, as rays and hits are below: a mask that was just written, copied as a part of a whole register, is waited
// for.
static inline void meet_nothing(struct found *hit) {
    hit->found = v_mask_none();
    hit->t = v_splat(INFINITY);
    hit->shape = v_splat(-1.0f);
    hit->local = (struct vec){v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
}

// Camera rays. Where the camera is inside of a shape, march.c has the frame.
INLINE void meet(int i, struct vec direction, vmask active, const struct eye *eyes,
                 const struct prepared *scene, struct found *hit) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    vfloat t;
    vmask met;
    struct vec local;
    if (s->type == SHAPE_MANDELBULB || REPEATED(s)) // by meet_bulbs(), meet_layers()
        return;
    ACTIVE(v_count(active));
    if (s->way == LINEAR) {
        COUNT(meet, plane);
        vfloat slope = dot_with(s->normal, direction);
        t = v_splat(eyes[i].height) / (v_splat(0.0f) - slope);
        met = v_and(active, v_cmp_lt(slope, v_splat(0.0f))); // the camera is above it
        local = hit->local;
    } else {
        COUNT(meet, solid);
        vmask behind;
        met = enter(vec_set(eyes[i].at), turned(s, direction), s, active, &t, &local, &behind);
    }
    take(v_and(met, v_cmp_lt(t, hit->t)), t, local, s, hit);
}

// Mirror rays start off a surface by surface_offset: in a crevice, inside of another solid. Like a march they
// then hit it at once, at the distance that they are at, which is negative.
INLINE vmask meet_from(struct vec o, struct vec d, const struct placed *s, vmask active, vmask own,
                       vfloat *t, struct vec *local) {
    COUNT(meet_from, call);
    if (s->convex)
        active = v_andnot(own, active); // what it leaves, it does not meet again
    vmask within, met = enter(o, d, s, active, t, local, &within);
    if (!s->convex) {
        COUNT(meet_from, torus);
        within = v_and(v_andnot(own, active), v_cmp_lt(vec_dot(o, o), v_splat(s->bound_sq)));
    }
    if (!v_any(within))
        return met;
    COUNT(meet_from, within);
    vfloat h = distance_at(o, s, v_mask_none());
    vmask inside = v_and(within, v_cmp_lt(h, v_splat(0.0f)));
    *t = v_select(inside, h, *t);
    *local = vec_select(inside, vec_along(o, d, h), *local);
    return v_or(met, inside);
}

INLINE void meet_mirror(int i, const struct ray *ray, const struct prepared *scene,
                        struct found *hit) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    ACTIVE(v_count(ray->active));
    vmask own = same_shape(ray->leaves, i), met;
    vfloat t;
    struct vec local = hit->local;
    if (s->type == SHAPE_MANDELBULB) // by meet_bulbs()
        return;
    COUNT(mirror_hit, shape);
    if (s->way == LINEAR) {
        COUNT(mirror_hit, plane);
        vfloat slope = dot_with(s->normal, ray->direction), height = height_over(s, ray->origin);
        vmask under = v_cmp_lt(height, v_splat(0.0f));
        t = v_select(under, height, height / (v_splat(0.0f) - slope));
        met = v_and(v_andnot(own, ray->active), v_or(under, v_cmp_lt(slope, v_splat(0.0f))));
    } else if (REPEATED(s)) {
        COUNT(mirror_hit, repeated);
        vfloat end = v_min(until_bounds(ray->origin, ray->direction, &scene->model.march), hit->t);
        met = meet_cells(ray, s, own, end, (float)scene->model.march.surface_offset, &t, &local);
    } else {
        COUNT(mirror_hit, solid);
        met = meet_from(in_frame(s, ray->origin), turned(s, ray->direction), s, ray->active, own,
                        &t, &local);
    }
    take(v_and(met, v_cmp_lt(t, hit->t)), t, local, s, hit);
}

static struct found mirror_hit(const struct ray *ray, const struct convex *work) {
    COUNT(mirror_hit, call);
    struct found hit;
    meet_nothing(&hit);
    if (IS_CROWD(work->scene)) {
        int *list = work->desk->mirrored;
        int count = crowd_along(ray->origin, ray->direction, ray->active, work, list);
        for (int k = 0; k < count; k++)
            meet_mirror(list[k], ray, work->scene, &hit);
    } else
        EACH_SHAPE(work->scene, meet_mirror, ray, work->scene, &hit);
    return hit;
}

#endif
