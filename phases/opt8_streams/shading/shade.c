// The colour of hits: light (B. T. Phong, "Illumination for computer generated pictures", CACM 18 (1975)) and fog.
// Shadow and mirror rays are queued.
#include "cones/march_scratch.h"
#include "cones/tile_cones.h"
#include "core/packet_group.h"
#include "core/ray_queues.h"
#include "core/shape_distances.h"
#include "core/trace.h"
#include "core/trace_context.h"
#include "groups/field_part.h"

// The materials of a packet's hits.
struct surface {
    struct vec color;
    vfloat share, shininess, shine_from;
};

// Sets the materials of hits on a group: a mixture of its shapes'.
static void mix_surface(vmask same, const struct primitive *s, const struct packet_rays *packet,
                        struct surface *all) {
    struct field_part part = field_at_origin(&packet->local[(int)s->index], s, same);
    all->color = vec_select(same, part.color, all->color);
    all->share = v_select(same, part.reflectivity * v_splat(0.1f), all->share);
    all->shininess = v_select(same, part.shininess, all->shininess);
    all->shine_from = v_select(same, v_splat(0.0f), all->shine_from);
}

// Gathers the materials, once for each shape that the packet hit.
static struct surface surface_of(const struct hit *hit, const struct prepared *scene,
                                 const struct packet_rays *packet) {
    float id[LANES];
    v_store(hit->shape, id);
    struct surface all = {0};
    for (unsigned rest = v_mask_bits(hit->found); rest;) {
        const struct primitive *s = &scene->primitives[(int)id[__builtin_ctz(rest)]];
        vmask same = v_and(hit->found, is_shape(hit->shape, (int)s->index));
        rest &= ~v_mask_bits(same);
        if (s->eval == EVAL_FIELD) {
            mix_surface(same, s, packet, &all);
            continue;
        }
        all.color = vec_select(same, vec_set(s->color), all.color);
        all.share = v_select(same, v_splat(s->share), all.share);
        all.shininess = v_select(same, v_splat(s->shininess), all.shininess);
        all.shine_from = v_select(same, v_splat(s->shine_from), all.shine_from);
    }
    return all;
}

// Returns the light's contribution to the pixel if nothing is in its way.
static struct vec light_at(struct vec n, struct vec direction, const struct lighting *light,
                           vfloat weight, const struct surface *surface, const struct view *view) {
    struct vec base = surface->color;
    vfloat reach = weight / light->distance, facing = light->facing;
    // The mirrored direction is minus the paper's R.
    vfloat shine = vec_dot(vec_reflect(light->to_light, n), direction);
    vfloat specular = v_splat(0.0f);
    vmask shines = v_and(light->front, v_cmp_gt(shine, surface->shine_from));
    if (v_any(shines)) {
        specular = v_select_or_zero(
            shines, v_splat(0.2f) * v_pow(v_max(shine, v_splat(1e-30f)), surface->shininess));
    }
    const double *e = view->light_emission;
    return (struct vec){v_splat((float)e[0]) * v_madd(base.x, facing, specular) * reach,
                        v_splat((float)e[1]) * v_madd(base.y, facing, specular) * reach,
                        v_splat((float)e[2]) * v_madd(base.z, facing, specular) * reach};
}

static void queue_shadow(vmask m, const struct hit *hit, const struct lighting *light,
                         struct vec bright, vfloat pixel, struct ray_queues *queues) {
    int at = queues->shadows;
    float (*field)[QUEUE_ROOM] = queues->shadow;
    pack_vec(m, hit->point.hi, field + S_HI, at);
    pack_vec(m, hit->point.lo, field + S_LO, at);
    pack_vec(m, light->to_light, field + S_TO_LIGHT, at);
    v_compress_store(m, light->distance, &field[S_DISTANCE][at]);
    pack_vec(m, bright, field + S_LIGHT, at);
    v_compress_store(m, pixel, &field[S_PIXEL][at]);
    queues->shadows += __builtin_popcount(v_mask_bits(m));
}

static void queue_mirror(vmask m, const struct hit *hit, struct vec direction, vfloat weight,
                         vfloat share, vfloat pixel, vfloat bounce,
                         const struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    int at = queues->mirrors;
    float (*field)[QUEUE_ROOM] = queues->mirror;
    vfloat offset = v_splat((float)world->scene->model.march.surface_offset);
    struct point from = point_at(hit->point, hit->normal, offset, v_splat(0.0f));
    pack_vec(m, from.hi, field + M_HI, at);
    pack_vec(m, from.lo, field + M_LO, at);
    pack_vec(m, vec_reflect(direction, hit->normal), field + M_DIRECTION, at);
    v_compress_store(m, weight * share, &field[M_WEIGHT][at]);
    v_compress_store(m, pixel, &field[M_PIXEL][at]);
    v_compress_store(m, bounce + v_splat(1.0f), &field[M_BOUNCE][at]);
    queues->mirrors += __builtin_popcount(v_mask_bits(m));
}

// Scales the light of unshadowed rays by their own shape's terms, where the surface rises slowly.
static struct vec scale_by_self_shadow(struct vec bright, vmask clear, const struct hit *hit,
                                       const struct lighting *light,
                                       const struct packet_rays *packet,
                                       const struct prepared *scene) {
    float id[LANES];
    v_store(hit->shape, id);
    vmask grazes = v_cmp_lt_in(clear, light->facing, v_splat(scene->lit_slope));
    for (unsigned rest = v_mask_bits(grazes); rest;) {
        int i = (int)id[__builtin_ctz(rest)];
        vmask same = v_and(grazes, is_shape(hit->shape, i));
        rest &= ~v_mask_bits(same);
        vfloat lit = self_shadow(&scene->primitives[i], packet->local[i].origin, hit->normal, light,
                                 &scene->model);
        bright = vec_select(same, vec_scale(bright, lit), bright);
    }
    return bright;
}

// Adds the light on a packet's hits where no march is needed. The other shadow rays are queued.
static struct vec lit_color(struct vec color, struct vec bright, const struct hit *hit,
                            const struct lighting *light, vfloat pixel,
                            const struct packet_rays *packet, struct trace_context *world) {
    const struct prepared *scene = world->scene;
    bool soft = scene->model.shadows == SHADOWS_SOFT;
    vmask open = light->front;
    if (scene->model.shadows != SHADOWS_NONE) {
        bool marched = !scene->all_bounded || scene->model.shadows == SHADOWS_IDEAL;
        open = marched ? v_mask_none() : trivially_lit(hit, light, packet, world);
        vmask shadowed = v_andnot(open, light->front);
        if (v_any(shadowed))
            queue_shadow(shadowed, hit, light, bright, pixel, world->queues);
        if (soft && v_any(open))
            bright = scale_by_self_shadow(bright, open, hit, light, packet, scene);
    }
    return (struct vec){v_add_where(open, color.x, bright.x), v_add_where(open, color.y, bright.y),
                        v_add_where(open, color.z, bright.z)};
}

// Returns the colours of a packet's rays, apart from queued shadows and mirrors.
static struct vec color_of(const struct ray_group *rays, int k, const struct hit *hit,
                           const struct lighting *light, const struct packet_rays *packet,
                           struct trace_context *world) {
    const struct model *model = &world->scene->model;
    const double *b = model->background;
    struct vec background = {v_splat((float)b[0]), v_splat((float)b[1]), v_splat((float)b[2])};
    struct vec color = vec_scale(background, rays->weight[k]);
    if (!v_any(hit->found))
        return color;
    vfloat weight = rays->weight[k];
    struct surface surface = surface_of(hit, world->scene, packet);
    if (model->features.fog) {
        struct vec p = hit->point.hi;
        vfloat far_sq = vec_dot(p, p);
        weight = weight * v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq));
    }
    color =
        vec_select(hit->found, vec_scale(surface.color, weight * v_splat(0.01f)), color); // ambient
    if (v_any(light->front)) {
        struct vec bright =
            light_at(hit->normal, rays->direction[k], light, weight, &surface, world->view);
        color = lit_color(color, bright, hit, light, rays->pixel[k], packet, world);
    }
    if (model->features.mirrors) {
        vmask on = v_cmp_lt(rays->bounce[k], v_splat((float)model->march.max_bounces));
        vmask mirror = v_and(hit->found, v_and(on, v_cmp_gt(surface.share, v_splat(0.0f))));
        if (v_any(mirror))
            queue_mirror(mirror, hit, rays->direction[k], weight, surface.share, rays->pixel[k],
                         rays->bounce[k], world);
    }
    return color;
}

// Without a Mandelbulb no shadow ray waits for those of other groups: neighbours have shorter lists.
void trace(const struct ray_group *rays, struct trace_context *world, struct vec *color,
           struct hit *hit) {
    if (world->queues->shadows > (world->scene->bulbs > 0 ? QUEUE - GROUP_RAYS : 0)) {
        struct shape_list list = world->group->packet[0].list;
        cast_shadows(world);
        for (int k = 0; k < GROUP; k++)
            world->group->packet[k].list = list;
    }
    struct lighting light[GROUP];
    vmask front = v_mask_none();
    ray_march(rays, world, hit);
    for (int k = 0; k < GROUP; k++) {
        light[k].front = v_mask_none();
        if (v_any(hit[k].found))
            light[k] = light_from(hit[k].point, hit[k].normal, hit[k].found, world->view);
        front = v_or(front, light[k].front);
    }
    if (v_any(front) && world->scene->model.shadows != SHADOWS_NONE)
        list_occluders(hit, light, world);
    for (int k = 0; k < GROUP; k++)
        if (v_any(rays->active[k]))
            color[k] = color_of(rays, k, &hit[k], &light[k], &world->group->packet[k], world);
}

// Traces the queued mirror rays, the last ones first, because they may queue more.
void follow_mirrors(struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    float (*field)[QUEUE_ROOM] = queues->mirror;
    while (queues->mirrors > 0) {
        int count = queues->mirrors < GROUP_RAYS ? queues->mirrors : GROUP_RAYS;
        int first = queues->mirrors -= count;
        struct ray_group rays = {.start = v_splat(0.0f), .marched = -1};
        for (int k = 0; k < GROUP; k++, first += LANES, count -= LANES) {
            rays.origin[k] =
                (struct point){load_vec(field + M_HI, first), load_vec(field + M_LO, first)};
            rays.direction[k] = load_vec(field + M_DIRECTION, first);
            rays.active[k] = lanes_until(count);
            rays.weight[k] = v_load(&field[M_WEIGHT][first]);
            rays.pixel[k] = v_load(&field[M_PIXEL][first]);
            rays.bounce[k] = v_load(&field[M_BOUNCE][first]);
        }
        list_for_bundle(&rays, NULL, LIST_HIT, world, world->scratch->mirror);
        struct vec color[GROUP];
        struct hit hit[GROUP];
        trace(&rays, world, color, hit);
        for (int k = 0; k < GROUP; k++)
            if (v_any(rays.active[k]))
                add_light(rays.active[k], color[k], rays.pixel[k], queues);
    }
}
