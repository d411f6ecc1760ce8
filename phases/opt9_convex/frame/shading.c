// Shades a group of packets: normals in closed form, light (frame/lighting.h), and the queues of shadow and
// mirror rays. Scenes without secondary rays: frame/primary_hits.c.
#include "bulb/bulb_estimate.h"
#include "bvh/bvh_lists.h"
#include "frame/lighting.h"
#include "hit/scene_bounds.h"
#include "hit/solids.h"
#include "repetition/repeated_rays.h"
#include "shadow/shadow_rays.h"

// Returns the normals of a Mandelbulb: forward differences of its estimate.
static struct vec bulb_normal(struct vec p, vmask found, const struct primitive *s, float step) {
    // Differences along the world's axes, as in every phase: columns of the shape's matrix.
    struct vec at[4] = {p};
    for (int k = 0; k < 3; k++)
        at[k + 1] =
            (struct vec){p.x + v_splat(step * s->turn[0][k]), p.y + v_splat(step * s->turn[1][k]),
                         p.z + v_splat(step * s->turn[2][k])};
    struct scaled_orbit b[4];
    vfloat f[4];
    for (int k = 0; k < 4; k++)
        bulb_begin(&b[k], at[k], found);
    bulbs_end(s, 0, false, LANES < 16, true, 4, b, at,
              f); // 11 bits (8 lanes) are too few, 14 (16 lanes) suffice
    struct vec n = {f[1] - f[0], f[2] - f[0], f[3] - f[0]};
    // Near its centre the estimate is 0, or NaN after many iterations: any direction will do there.
    vfloat size = vec_norm(n);
    vmask some = v_cmp_gt(size, v_splat(0.0f));
    n = (struct vec){v_select_or_zero(some, n.x), v_select(some, n.y, v_splat(1.0f)),
                     v_select_or_zero(some, n.z)};
    return vec_scale(n, v_splat(1.0f) / v_select(some, size, v_splat(1.0f)));
}

// Sets the surface of the lanes that hit a group: materials are mixed in a blend.
static void group_surface(const struct primitive *s, struct vec p, vmask same,
                          struct surface *all) {
    struct field_surface at =
        SHARP_OF(s) ? sharp_surface(SHARP_OF(s), p, same) : field_surface(FIELD_OF(s), p, same);
    all->normal = vec_select(same, turned_back(s, at.normal), all->normal);
    all->color = vec_select(same, at.color, all->color);
    all->share = v_select(same, at.reflectivity * v_splat(0.1f), all->share);
    all->shininess = v_select(same, at.shininess, all->shininess);
    vfloat from = v_exp(v_splat(-20.723266f) / at.shininess); // 1e-9 to the power of 1/shininess
    all->shine_from = v_select(same, from, all->shine_from);
}

// Sets the surface of the lanes that hit shape i.
INLINE void surface_of(int i, const struct surface_hit *hit, const struct prepared *scene,
                       struct surface *all) {
    const struct primitive *s = &KNOWN(scene)->primitives[i];
    vmask same = v_and(hit->found, is_shape(hit->shape, i));
    if (!v_any(same))
        return;
    struct vec normal = vec_set(s->normal);
    if (s->type == SHAPE_MANDELBULB)
        normal = bulb_normal(hit->local, same, s, (float)scene->model.march.normal_step);
    else if (IS_GROUP(s)) {
        group_surface(s, hit->local, same, all);
        return;
    } else if (s->eval != EVAL_LINEAR)
        normal = turned_back(s, normal_on(hit->local, s));
    all->normal = vec_select(same, normal, all->normal);
    all->color = vec_select(same, vec_set(s->color), all->color);
    all->share = v_select(same, v_splat(s->share), all->share);
    all->shininess = v_select(same, v_splat(s->shininess), all->shininess);
    all->shine_from = v_select(same, v_splat(s->shine_from), all->shine_from);
}

// Sets the surfaces of a packet's hits. Normals point towards the rays' origins.
static void surface_at(const struct surface_hit *restrict hit, const struct vec *restrict direction,
                       const struct prepared *scene, struct surface *restrict all) {
    struct vec none = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    all->normal = all->color = none;
    all->share = all->shininess = all->shine_from = v_splat(0.0f);
    unsigned left = v_mask_bits(hit->found);
    UNROLL_SHAPES
    for (int k = 0; hits_left(left, k); k++)
        surface_of(next_hit_shape(&left, hit->shape, k), hit, scene, all);
    vmask away = v_cmp_gt(vec_dot(all->normal, *direction), v_splat(0.0f));
    all->normal =
        (struct vec){v_negate_where(away, all->normal.x), v_negate_where(away, all->normal.y),
                     v_negate_where(away, all->normal.z)};
}

// Queues the shadow rays of the lanes in m. A full queue is emptied first.
static void queue_shadow(vmask m, struct vec p, const struct surface_hit *hit, struct vec to_light,
                         vfloat facing, struct vec light, vfloat pixel,
                         const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    if (scratch->shadows > QUEUE - LANES)
        cast_shadows(work);
    int at = scratch->shadows;
    float (*field)[QUEUE_ROOM] = scratch->shadow;
    pack_vec(m, p, field + S_POINT, at);
    pack_vec(m, hit->local, field + S_LOCAL, at);
    pack_vec(m, to_light, field + S_TO_LIGHT, at);
    pack_vec(m, light, field + S_LIGHT, at);
    v_compress_store(m, facing, &field[S_FACING][at]);
    v_compress_store(m, hit->shape, &field[S_SHAPE][at]);
    v_compress_store(m, pixel, &field[S_PIXEL][at]);
    scratch->shadows += v_count(m);
}

// Queues the mirror rays of the lanes in m, with this weight.
static void queue_mirror(vmask m, const struct packet_ray *ray, struct vec p, struct vec n,
                         vfloat weight, const struct surface_hit *hit,
                         const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    int at = scratch->mirrors;
    float (*field)[QUEUE_ROOM] = scratch->mirror;
    float offset = (float)work->scene->model.march.surface_offset;
    pack_vec(m, vec_along(p, n, v_splat(offset)), field + M_ORIGIN, at);
    pack_vec(m, vec_reflect(ray->direction, n), field + M_DIRECTION, at);
    v_compress_store(m, weight, &field[M_WEIGHT][at]);
    v_compress_store(m, ray->pixel, &field[M_PIXEL][at]);
    v_compress_store(m, ray->bounce + v_splat(1.0f), &field[M_BOUNCE][at]);
    v_compress_store(m, hit->shape, &field[M_LEAVES][at]);
    if (REPEATS(work->scene))
        pack_vec(m, hit->local, field + M_LOCAL, at);
    scratch->mirrors += v_count(m);
}

// Multiplies the light of rays that graze the shape i by its self-shadow.
INLINE void graze(int i, vmask grazes, const struct surface_hit *hit, struct vec to_light,
                  vfloat facing, const struct prepared *scene, struct vec *light) {
    vmask same = v_and(grazes, is_shape(hit->shape, i));
    if (!v_any(same))
        return;
    vfloat lit = self_shadow(&KNOWN(scene)->primitives[i], hit->local, to_light, facing, scene);
    *light = vec_select(same, vec_scale(*light, lit), *light);
}

// Returns whether all hits of the packet are on the scene's first plane, from above. This is the most
// frequent case.
INLINE bool all_on_plane(const struct shading_packet *at, const struct known_scene *scene) {
    if (scene->plane < 0)
        return false;
    vfloat slope = add_dot(scene->primitives[scene->plane].normal, at->ray.direction);
    vmask on = v_andnot(v_cmp_gt(slope, v_splat(0.0f)), is_shape(at->hit.shape, scene->plane));
    return !v_any(v_andnot(on, at->hit.found));
}

INLINE struct surface surface_of_plane(const struct known_scene *scene) {
    const struct primitive *s = &scene->primitives[scene->plane];
    return (struct surface){vec_set(s->normal), vec_set(s->color), v_splat(s->share),
                            v_splat(s->shininess), v_splat(s->shine_from)};
}

static inline void find_surfaces(struct shading_packet *at, const struct prepared *scene) {
    struct packet_ray *ray = &at->ray;
    at->point = vec_along(ray->origin, ray->direction, at->hit.t);
    at->hit.found = v_and(at->hit.found, in_bounds(at, KNOWN(scene)));
    at->front = v_mask_none();
    at->flat = false;
    if (!v_any(at->hit.found))
        return;
    at->flat = all_on_plane(at, KNOWN(scene));
    if (at->flat)
        at->surface = surface_of_plane(KNOWN(scene));
    else
        surface_at(&at->hit, &ray->direction, scene, &at->surface);
}

// Lights the packet. Two calls, so that a kernel knows the plane's material in the first.
static inline void light_stage(struct shading_packet *at, const struct tile_context *work) {
    const struct known_scene *scene = KNOWN(work->scene);
    if (at->flat) {
        struct surface plane = surface_of_plane(scene);
        light_surfaces(at, &plane, scene->primitives[scene->plane].normal, work);
    } else
        light_surfaces(at, &at->surface, NULL, work);
}

// Returns whether each shadow ray queries the BVH by itself (bvh_trivially_lit) in place of testing a list
// for the group. With three levels that list is so long that testing it costs more than the queries.
static inline bool queries_rays_singly(const struct prepared *scene) {
    return HAS_BVH(scene) && scene->model.shadows == SHADOWS_SOFT &&
           scene->bvh.levels == BVH_LEVELS;
}

// Sets at->open: which rays reach the light without a march.
static inline void cull_shadows(struct shading_packet *at, const struct tile_context *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    at->open = at->front;
    if (!v_any(at->front))
        return;
    // HAS_BVH is repeated here because a kernel without optimization would refer to bvh_trivially_lit().
    if (HAS_BVH(work->scene) && queries_rays_singly(work->scene))
        at->open = bvh_trivially_lit(at->point, at->hit.local, at->to_light, at->facing,
                                     at->hit.shape, at->front, work);
    else if (model->shadows == SHADOWS_SOFT)
        at->open = trivially_lit(&at->point, &at->hit.local, &at->to_light, at->facing,
                                 at->hit.shape, at->front, work);
    else if (model->shadows == SHADOWS_HARD) {
        struct vec to = vec_sub(vec_from_doubles(work->view->light_position), at->point);
        at->open = reaches_light(at->point, at->hit.local, at->to_light, at->hit.shape,
                                 vec_norm(to), at->front, work);
    }
}

// Adds the light that needs no march, and queues shadow and mirror rays for the rest.
static inline void queue_or_add(struct shading_packet *at, const struct tile_context *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    vfloat zero = v_splat(0.0f);
    vmask open = at->open;
    if (model->shadows == SHADOWS_SOFT) {
        vmask doubtful = v_andnot(open, at->front);
        vmask grazes = v_and(open, v_cmp_lt(at->facing, v_splat(KNOWN(work->scene)->lit_slope)));
        if (v_any(doubtful))
            queue_shadow(doubtful, at->point, &at->hit, at->to_light, at->facing, at->light,
                         at->ray.pixel, work);
        if (v_any(grazes)) {
            unsigned left = v_mask_bits(grazes);
            UNROLL_SHAPES
            for (int k = 0; hits_left(left, k); k++)
                graze(next_hit_shape(&left, at->hit.shape, k), grazes, &at->hit, at->to_light,
                      at->facing, work->scene, &at->light);
        }
    }
    at->color.x = at->color.x + v_select_or_zero(open, at->light.x);
    at->color.y = at->color.y + v_select_or_zero(open, at->light.y);
    at->color.z = at->color.z + v_select_or_zero(open, at->light.z);
    if (model->features.mirrors && model->march.max_bounces > 0) {
        vmask mirror = v_and(v_and(at->hit.found, v_cmp_gt(at->surface.share, zero)),
                             v_cmp_lt(at->ray.bounce, v_splat((float)model->march.max_bounces)));
        if (v_any(mirror)) {
            queue_mirror(mirror, &at->ray, at->point, at->surface.normal,
                         at->weight * at->surface.share, &at->hit, work);
        }
    }
}

void shade_packets(struct shading_packet *stage, int count, const struct tile_context *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    for (int i = 0; i < count; i++)
        find_surfaces(&stage[i], work->scene);
    for (int i = 0; i < count; i++)
        if (v_any(stage[i].hit.found))
            light_stage(&stage[i], work);
    if (model->shadows != SHADOWS_NONE && !queries_rays_singly(work->scene))
        list_occluders(stage, count, work);
    for (int i = 0; i < count; i++)
        if (v_any(stage[i].hit.found))
            cull_shadows(&stage[i], work);
    for (int i = 0; i < count; i++)
        if (v_any(stage[i].hit.found))
            queue_or_add(&stage[i], work);
        else
            stage[i].color = background(stage[i].ray.weight, model);
}

KERNEL_SHARED void primary_normals(struct primary_hit *seen, const struct prepared *scene) {
    if (!v_any(seen->hit.found))
        return;
    struct surface all;
    surface_at(&seen->hit, &seen->direction, scene, &all);
    seen->hit.local = all.normal;
}
