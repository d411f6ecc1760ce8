// What camera and mirror rays meet of solids, planes and copies, by closed forms.
#ifndef OPT9_MEET_H
#define OPT9_MEET_H

#include "cells.h"
#include "crowd.h"
#include "desk.h"

INLINE void take(mask met, real t, struct vec local, const struct placed *s, struct found *hit) {
    if (!any(met))
        return;
    hit->found = either(hit->found, met);
    hit->t = choose(met, t, hit->t);
    hit->shape = choose(met, set(s->index), hit->shape);
    hit->local = vec_choose(met, local, hit->local);
}

// Part by part, as rays and hits are below: a mask that was just written, copied as a part of a whole register, is waited
// for.
static inline void meet_nothing(struct found *hit) {
    hit->found = no_lane();
    hit->t = set(INFINITY);
    hit->shape = set(-1.0f);
    hit->local = (struct vec){set(0.0f), set(0.0f), set(0.0f)};
}

// Camera rays. Where the camera is inside of a shape, march.c has the frame.
INLINE void meet(int i, struct vec direction, mask active, const struct eye *eyes,
                 const struct prepared *scene, struct found *hit) {
    COUNT(meet, call);
    const struct placed *s = &KNOWN(scene)->placed[i];
    real t;
    mask met;
    struct vec local;
    if (s->type == SHAPE_MANDELBULB || REPEATED(s)) // by meet_bulbs(), meet_layers()
        return;
    ACTIVE(count_of(active));
    if (s->way == LINEAR) {
        COUNT(meet, plane);
        real slope = dot_with(s->normal, direction);
        t = set(eyes[i].height) / (set(0.0f) - slope);
        met = both(active, less(slope, set(0.0f))); // the camera is above it
        local = hit->local;
    } else {
        COUNT(meet, solid);
        mask behind;
        met = enter(vec_set(eyes[i].at), turned(s, direction), s, active, &t, &local, &behind);
    }
    take(both(met, less(t, hit->t)), t, local, s, hit);
}

// Mirror rays start off a surface by surface_offset: in a crevice, inside of another solid. Like a march they
// then hit it at once, at the distance that they are at, which is negative.
INLINE mask meet_from(struct vec o, struct vec d, const struct placed *s, mask active, mask own,
                      real *t, struct vec *local) {
    COUNT(meet_from, call);
    if (s->convex)
        active = but_not(own, active); // what it leaves, it does not meet again
    mask within, met = enter(o, d, s, active, t, local, &within);
    if (!s->convex) {
        COUNT(meet_from, torus);
        within = both(but_not(own, active), less(vec_dot(o, o), set(s->bound_sq)));
    }
    if (!any(within))
        return met;
    COUNT(meet_from, within);
    real h = distance_at(o, s, no_lane());
    mask inside = both(within, less(h, set(0.0f)));
    *t = choose(inside, h, *t);
    *local = vec_choose(inside, vec_along(o, d, h), *local);
    return either(met, inside);
}

INLINE void meet_mirror(int i, const struct ray *ray, const struct prepared *scene,
                        struct found *hit) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    ACTIVE(count_of(ray->active));
    mask own = same_shape(ray->leaves, i), met;
    real t;
    struct vec local = hit->local;
    if (s->type == SHAPE_MANDELBULB) // by meet_bulbs()
        return;
    COUNT(mirror_hit, shape);
    if (s->way == LINEAR) {
        COUNT(mirror_hit, plane);
        real slope = dot_with(s->normal, ray->direction), height = height_over(s, ray->origin);
        mask under = less(height, set(0.0f));
        t = choose(under, height, height / (set(0.0f) - slope));
        met = both(but_not(own, ray->active), either(under, less(slope, set(0.0f))));
    } else if (REPEATED(s)) {
        COUNT(mirror_hit, repeated);
        real end = least_of(until_bounds(ray->origin, ray->direction, &scene->model.march), hit->t);
        met = meet_cells(ray, s, own, end, (float)scene->model.march.surface_offset, &t, &local);
    } else {
        COUNT(mirror_hit, solid);
        met = meet_from(in_frame(s, ray->origin), turned(s, ray->direction), s, ray->active, own,
                        &t, &local);
    }
    take(both(met, less(t, hit->t)), t, local, s, hit);
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
