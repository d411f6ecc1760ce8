// What a group's hits look like: normals in closed form, light (light.h), and what has to wait for a shadow or a mirror
// ray. Where nothing ever waits: seen.c.
#include "bounds.h"
#include "bulb.h"
#include "cells.h"
#include "crowd.h"
#include "light.h"
#include "occluders.h"

// Forward differences of the estimate, the only normal it has.
static struct vec bulb_normal(struct vec p, mask found, const struct placed *s, float step) {
    ACTIVE(count_of(found));
    COUNT(bulb_normal, call);
    COUNT(bulb_normal, scalar);
    mask done = not_in(found);
    // Along the world's axes, as in every phase: columns of the shape's matrix.
    struct vec at[4] = {p};
    for (int k = 0; k < 3; k++)
        at[k + 1] = (struct vec){p.x + set(step * s->turn[0][k]), p.y + set(step * s->turn[1][k]),
                                 p.z + set(step * s->turn[2][k])};
    struct bulb b[4];
    real f[4];
    for (int k = 0; k < 4; k++)
        b[k] = bulb_begin(at[k], done);
    bulbs_end(s, 0, false, LANES < 16, true, 4, b, at, f); // 11 bits are too few, 14 are not
    struct vec n = {f[1] - f[0], f[2] - f[0], f[3] - f[0]};
    // About its centre the estimate is 0 everywhere, and of many iterations no number at times: any direction will do.
    real size = vec_norm(n);
    mask some = greater(size, set(0.0f));
    n = (struct vec){keep(some, n.x), choose(some, n.y, set(1.0f)), keep(some, n.z)};
    return vec_scale(n, set(1.0f) / choose(some, size, set(1.0f)));
}

INLINE void surface_of(int i, const struct found *hit, const struct prepared *scene,
                       struct surface *all) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    mask same = both(hit->found, same_shape(hit->shape, i));
    if (!any(same))
        return;
    ACTIVE(count_of(hit->found));
    COUNT(surface_at, shape);
    struct vec normal = vec_set(s->normal);
    if (s->type == SHAPE_MANDELBULB)
        normal = bulb_normal(hit->local, same, s, (float)scene->model.march.normal_step);
    else if (s->way != LINEAR)
        normal = turned_back(s, normal_on(hit->local, s));
    all->normal = vec_choose(same, normal, all->normal);
    all->color = vec_choose(same, vec_set(s->color), all->color);
    all->share = choose(same, set(s->share), all->share);
    all->shininess = choose(same, set(s->shininess), all->shininess);
    all->shine_from = choose(same, set(s->shine_from), all->shine_from);
}

// Once for each shape that the packet hit.
static void surface_at(const struct found *restrict hit, const struct vec *restrict direction,
                       const struct prepared *scene, struct surface *restrict all) {
    COUNT(surface_at, call);
    struct vec none = {set(0.0f), set(0.0f), set(0.0f)};
    all->normal = all->color = none;
    all->share = all->shininess = all->shine_from = set(0.0f);
    EACH_HIT(hit->found, hit->shape, scene, surface_of, hit, scene, all);
    mask away = greater(vec_dot(all->normal, *direction), set(0.0f));
    all->normal = (struct vec){negate_where(away, all->normal.x), negate_where(away, all->normal.y),
                               negate_where(away, all->normal.z)};
}

static void queue_shadow(mask m, struct vec p, const struct found *hit, struct vec to_light,
                         real facing, struct vec light, real pixel, const struct convex *work) {
    struct desk *desk = work->desk;
    if (desk->shadows > QUEUE - LANES)
        cast_shadows(work);
    int at = desk->shadows;
    float (*field)[QUEUE_ROOM] = desk->shadow;
    pack_vec(m, p, field + S_POINT, at);
    pack_vec(m, hit->local, field + S_LOCAL, at);
    pack_vec(m, to_light, field + S_TO_LIGHT, at);
    pack_vec(m, light, field + S_LIGHT, at);
    pack(m, facing, &field[S_FACING][at]);
    pack(m, hit->shape, &field[S_SHAPE][at]);
    pack(m, pixel, &field[S_PIXEL][at]);
    desk->shadows += count_of(m);
}

static void queue_mirror(mask m, const struct ray *ray, struct vec p, struct vec n, real weight,
                         const struct found *hit, const struct convex *work) {
    ACTIVE(count_of(m));
    COUNT(queue_mirror, call);
    struct desk *desk = work->desk;
    int at = desk->mirrors;
    float (*field)[QUEUE_ROOM] = desk->mirror;
    float offset = (float)work->scene->model.march.surface_offset;
    pack_vec(m, vec_along(p, n, set(offset)), field + M_ORIGIN, at);
    pack_vec(m, vec_reflect(ray->direction, n), field + M_DIRECTION, at);
    pack(m, weight, &field[M_WEIGHT][at]);
    pack(m, ray->pixel, &field[M_PIXEL][at]);
    pack(m, ray->bounce + set(1.0f), &field[M_BOUNCE][at]);
    pack(m, hit->shape, &field[M_LEAVES][at]);
    if (REPEATS(work->scene))
        pack_vec(m, hit->local, field + M_LOCAL, at);
    desk->mirrors += count_of(m);
}

INLINE void graze(int i, mask grazes, const struct found *hit, struct vec to_light, real facing,
                  const struct prepared *scene, struct vec *light) {
    mask same = both(grazes, same_shape(hit->shape, i));
    if (!any(same))
        return;
    ACTIVE(count_of(grazes));
    COUNT(graze, call);
    COUNT(stage_end, grazes);
    real lit = own_shadow(&KNOWN(scene)->placed[i], hit->local, to_light, facing, scene);
    *light = vec_choose(same, vec_scale(*light, lit), *light);
}

// Whether the packet's hits are all on the scene's first plane, from above: most packets' are.
INLINE bool all_on_plane(const struct stage *at, const struct known *scene) {
    COUNT(all_on_plane, call);
    if (scene->plane < 0)
        return false;
    COUNT(all_on_plane, plane);
    real slope = dot_with(scene->placed[scene->plane].normal, at->ray.direction);
    mask on = but_not(greater(slope, set(0.0f)), same_shape(at->hit.shape, scene->plane));
    return !any(but_not(on, at->hit.found));
}

INLINE struct surface surface_of_plane(const struct known *scene) {
    COUNT(surface_of_plane, call);
    const struct placed *s = &scene->placed[scene->plane];
    return (struct surface){vec_set(s->normal), vec_set(s->color), set(s->share), set(s->shininess),
                            set(s->shine_from)};
}

static inline void stage_surface(struct stage *at, const struct prepared *scene) {
    struct ray *ray = &at->ray;
    ACTIVE(count_of(at->hit.found));
    COUNT(stage_surface, call);
    COUNT(stage_surface, scalar);
    at->point = vec_along(ray->origin, ray->direction, at->hit.t);
    at->hit.found = both(at->hit.found, in_bounds(at, KNOWN(scene)));
    at->lit = no_lane();
    at->flat = false;
    if (!any(at->hit.found))
        return;
    at->flat = all_on_plane(at, KNOWN(scene));
    if (at->flat)
        at->surface = surface_of_plane(KNOWN(scene));
    else
        surface_at(&at->hit, &ray->direction, scene, &at->surface);
}

// Twice, so that a generated kernel knows the plane's material in the first.
static inline void light_stage(struct stage *at, const struct convex *work) {
    COUNT(light_stage, call);
    const struct known *scene = KNOWN(work->scene);
    if (at->flat) {
        struct surface plane = surface_of_plane(scene);
        stage_light(at, &plane, scene->placed[scene->plane].normal, work);
    } else
        stage_light(at, &at->surface, NULL, work);
}

// In a tree of all levels a group's list of what may shade it is so long that each ray is better asked by itself: 4,096
// scattered shapes 535 to 382 ms with it, 469 without; 256 shapes 131, 122 and 103.
static inline bool asked_one_by_one(const struct prepared *scene) {
    return IS_CROWD(scene) && scene->model.shadows == SHADOWS_SOFT &&
           scene->tree.levels == TREE_LEVELS;
}

static inline void stage_shadow(struct stage *at, const struct convex *work) {
    COUNT(stage_shadow, call);
    const struct known_model *model = &KNOWN(work->scene)->model;
    at->open = at->lit;
    if (!any(at->lit))
        return;
    // IS_CROWD once more: without optimization too, a kernel must not refer to what is called here.
    if (IS_CROWD(work->scene) && asked_one_by_one(work->scene))
        at->open = crowd_clears(at->point, at->hit.local, at->to_light, at->facing, at->hit.shape,
                                at->lit, work);
    else if (model->shadows == SHADOWS_SOFT)
        at->open = cleared(&at->point, &at->hit.local, &at->to_light, at->facing, at->hit.shape,
                           at->lit, work);
    else if (model->shadows == SHADOWS_HARD) {
        ACTIVE(count_of(at->lit));
        COUNT(stage_shadow, hard);
        struct vec to = {set((float)work->view->light_position[0]) - at->point.x,
                         set((float)work->view->light_position[1]) - at->point.y,
                         set((float)work->view->light_position[2]) - at->point.z};
        at->open = reaches_light(at->point, at->hit.local, at->to_light, at->hit.shape,
                                 vec_norm(to), at->lit, work);
    }
}

// What reaches the pixels at once; what a shadow or a mirror ray will bring waits.
static inline void stage_end(struct stage *at, const struct convex *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    real zero = set(0.0f);
    mask open = at->open;
    ACTIVE(count_of(at->hit.found));
    COUNT(stage_end, call);
    if (model->shadows == SHADOWS_SOFT) {
        COUNT(stage_end, soft);
        mask asked = but_not(open, at->lit);
        mask grazes = both(open, less(at->facing, set(KNOWN(work->scene)->lit_slope)));
        if (any(asked))
            queue_shadow(asked, at->point, &at->hit, at->to_light, at->facing, at->light,
                         at->ray.pixel, work);
        if (any(grazes)) {
            EACH_HIT(grazes, at->hit.shape, work->scene, graze, grazes, &at->hit, at->to_light,
                     at->facing, work->scene, &at->light);
        }
    }
    at->color.x = at->color.x + keep(open, at->light.x);
    at->color.y = at->color.y + keep(open, at->light.y);
    at->color.z = at->color.z + keep(open, at->light.z);
    if (model->features.mirrors && model->march.max_bounces > 0) {
        COUNT(stage_end, mirrors);
        mask mirror = both(both(at->hit.found, greater(at->surface.share, zero)),
                           less(at->ray.bounce, set((float)model->march.max_bounces)));
        if (any(mirror)) {
            COUNT(stage_end, mirror);
            queue_mirror(mirror, &at->ray, at->point, at->surface.normal,
                         at->weight * at->surface.share, &at->hit, work);
        }
    }
}

void color_all(struct stage *stage, int count, const struct convex *work) {
    COUNT(color_all, call);
    const struct known_model *model = &KNOWN(work->scene)->model;
    for (int i = 0; i < count; i++)
        stage_surface(&stage[i], work->scene);
    for (int i = 0; i < count; i++)
        if (any(stage[i].hit.found))
            light_stage(&stage[i], work);
    if (model->shadows != SHADOWS_NONE && !asked_one_by_one(work->scene))
        choose_shading(stage, count, work);
    for (int i = 0; i < count; i++)
        if (any(stage[i].hit.found))
            stage_shadow(&stage[i], work);
    for (int i = 0; i < count; i++)
        if (any(stage[i].hit.found)) {
            stage_end(&stage[i], work);
        } else {
            COUNT(color_all, sky);
            stage[i].color = background(stage[i].ray.weight, model);
        }
}

SHARED void normals_seen(struct sight *seen, const struct prepared *scene) {
    if (!any(seen->hit.found))
        return;
    struct surface all;
    surface_at(&seen->hit, &seen->direction, scene, &all);
    seen->hit.local = all.normal;
}
