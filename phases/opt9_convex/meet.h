// What camera and mirror rays meet of solids, planes and copies, by closed forms.
#ifndef OPT9_MEET_H
#define OPT9_MEET_H

#include "cells.h"
#include "crowd.h"

static inline void take(mask met, real t, struct vec local, const struct placed *s,
                        struct found *hit) {
    if (!any(met))
        return;
    hit->found = either(hit->found, met);
    hit->t = choose(met, t, hit->t);
    hit->shape = choose(met, set(s->index), hit->shape);
    hit->local = vec_choose(met, local, hit->local);
}

// Camera rays. Where the camera is inside of a shape, march.c has the frame.
static void first_hit(struct vec direction, mask active, const struct eye *eyes, const int *list,
                      int count, const struct prepared *scene, struct found *hit) {
    COUNT(first_hit, call);
    real zero = set(0.0f);
    hit->found = no_lane();
    hit->t = set(INFINITY);
    hit->shape = set(-1.0f);
    hit->local = (struct vec){zero, zero, zero};
    for (int k = 0; k < count; k++) {
        int i = list[k];
        const struct placed *s = &scene->placed[i];
        real t;
        mask met;
        struct vec local;
        if (s->type == SHAPE_MANDELBULB || s->repeated) // by meet_bulbs(), meet_layers()
            continue;
        ACTIVE(count_of(active));
        if (s->way == LINEAR) {
            COUNT(first_hit, plane);
            real slope = vec_dot(vec_set(s->normal), direction);
            t = set(eyes[i].height) / (zero - slope);
            met = both(active, less(slope, zero)); // the camera is above it
            local = hit->local;
        } else {
            COUNT(first_hit, solid);
            mask behind;
            met = enter(vec_set(eyes[i].at), turned(s, direction), s, active, &t, &local, &behind);
        }
        take(both(met, less(t, hit->t)), t, local, s, hit);
    }
}

// Mirror rays start off a surface by surface_offset: in a crevice, inside of another solid. Like a march they
// then hit it at once, at the distance that they are at, which is negative.
static mask meet_from(struct vec o, struct vec d, const struct placed *s, mask active, mask own,
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

static void mirror_hit(const struct ray *ray, const struct convex *work, struct found *hit) {
    COUNT(mirror_hit, call);
    const struct prepared *scene = work->scene;
    int *list = scene->tree.levels ? work->desk->mirrored : NULL, count = scene->model.shape_count;
    if (list)
        count = crowd_along(ray->origin, ray->direction, ray->active, work, list);
    real zero = set(0.0f);
    *hit = (struct found){no_lane(), set(INFINITY), set(-1.0f), {zero, zero, zero}};
    real bounds = zero;
    if (scene->repeats)
        bounds = until_bounds(ray->origin, ray->direction, &scene->model.march);
    for (int k = 0; k < count; k++) {
        int i = list ? list[k] : k;
        const struct placed *s = &scene->placed[i];
        ACTIVE(count_of(ray->active));
        mask own = same_shape(ray->leaves, i), met;
        real t;
        struct vec local = hit->local;
        if (s->type == SHAPE_MANDELBULB) // by meet_bulbs()
            continue;
        COUNT(mirror_hit, shape);
        if (s->way == LINEAR) {
            COUNT(mirror_hit, plane);
            real slope = vec_dot(vec_set(s->normal), ray->direction);
            real height = height_over(s, ray->origin);
            mask under = less(height, zero);
            t = choose(under, height, height / (zero - slope));
            met = both(but_not(own, ray->active), either(under, less(slope, zero)));
        } else if (s->repeated) {
            COUNT(mirror_hit, repeated);
            met = meet_cells(ray, s, own, least_of(bounds, hit->t),
                             (float)scene->model.march.surface_offset, &t, &local);
        } else {
            COUNT(mirror_hit, solid);
            met = meet_from(in_frame(s, ray->origin), turned(s, ray->direction), s, ray->active,
                            own, &t, &local);
        }
        take(both(met, less(t, hit->t)), t, local, s, hit);
    }
}

#endif
