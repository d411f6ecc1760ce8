// The colour of a ray: the hit's colour in the light, mirrors by recursion, and fog.
#include "cones/march_scratch.h"
#include "cones/tile_cones.h"
#include "core/packet_group.h"
#include "core/trace.h"
#include "core/trace_context.h"
#include "shading/phong.h"

// Adds the mirrored colours to those of the reflective hits of a few packets. The recursive call is made if one ray is
// reflective. The other rays are masked.
static void mirror(const struct ray_group *rays, int bounce, struct trace_context *world,
                   const struct surfaces *surface, struct shaded *result) {
    struct point origin[SMALL_GROUP];
    struct vec direction[SMALL_GROUP];
    vmask activated[SMALL_GROUP];
    const struct ray_group mirrored = {origin, direction, activated, v_splat(0.0f)};
    bool one = false;
    for (int k = 0; k < SMALL_GROUP; k++) {
        const struct hit *hit = &result[k].hit;
        vmask active = v_and(hit->found, v_cmp_gt(surface[k].reflectivity, v_splat(0.0f)));
        activated[k] = active;
        if (!v_any(active))
            continue;
        one = true;
        vfloat offset = v_splat((float)world->scene->model.march.surface_offset);
        origin[k] = point_at(hit->point, hit->normal, offset, v_splat(0.0f));
        direction[k] = vec_reflect(rays->direction[k], hit->normal);
    }
    if (!one)
        return;
    set_group_size(world->group, SMALL_GROUP);
    list_for_bundle(&mirrored, NULL, LIST_HIT, world, world->scratch->mirror);
    struct shaded seen[SMALL_GROUP];
    trace(&mirrored, bounce + 1, world, seen);
    for (int k = 0; k < SMALL_GROUP; k++) {
        vmask active = activated[k];
        if (!v_any(active))
            continue;
        vfloat share = v_select_or_zero(active, surface[k].reflectivity * v_splat(0.1f));
        struct vec color = result[k].color;
        result[k].color = vec_along(color, vec_select(active, seen[k].color, color), share);
    }
}

// Traces all packets of the group. Each array has one element per packet.
static inline void trace_packets(const struct ray_group *rays, int bounce,
                                 struct trace_context *world, struct hit *hit,
                                 struct lighting *light, struct surfaces *surface, vfloat *reach,
                                 struct shaded *result) {
    const struct model *model = &world->scene->model;
    const double *b = model->background;
    struct vec background = {v_splat((float)b[0]), v_splat((float)b[1]), v_splat((float)b[2])};
    const int size = packets_in(world->group);
    ray_march(rays, world, hit);
    for (int k = 0; k < size; k++) {
        light[k].lit = v_mask_none();
        surface[k] = (struct surfaces){0};
        if (!v_any(hit[k].found))
            continue;
        surface[k] = gather(hit[k].shape, hit[k].found, world->scene, &world->group->packet[k]);
        light[k] = light_from(hit[k].point, hit[k].normal, hit[k].found, world->view);
    }
    shadow(hit, light, world, reach);
    for (int k = 0; k < size; k++) {
        result[k] = (struct shaded){.color = background, .hit = hit[k]};
        if (v_any(hit[k].found))
            result[k].color = light_at(hit[k].normal, rays->direction[k], &light[k], reach[k],
                                       &surface[k], world->view);
    }
    if (model->features.mirrors && bounce < model->march.max_bounces)
        for (int first = 0; first < size; first += SMALL_GROUP) {
            const struct ray_group some = {rays->origin + first, rays->direction + first,
                                           rays->active + first, rays->start};
            mirror(&some, bounce, world, surface + first, result + first);
        }
    for (int k = 0; k < size; k++) {
        struct vec color = result[k].color;
        if (!v_any(hit[k].found))
            continue;
        if (model->features.fog) {
            struct vec p = hit[k].point.hi;
            vfloat far_sq = vec_dot(p, p);
            color = vec_scale(color, v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq)));
        }
        result[k].color = vec_select(hit[k].found, color, background);
    }
}

// A large group holds camera rays only, so the recursion's arrays stay small and every bounce fits the stack.
__attribute__((noinline)) static void trace_many(const struct ray_group *rays, int bounce,
                                                 struct trace_context *world,
                                                 struct shaded *result) {
    struct hit hit[GROUP];
    struct lighting light[GROUP];
    struct surfaces surface[GROUP];
    vfloat reach[GROUP];
    trace_packets(rays, bounce, world, hit, light, surface, reach, result);
}

__attribute__((noinline)) static void trace_few(const struct ray_group *rays, int bounce,
                                                struct trace_context *world,
                                                struct shaded *result) {
    struct hit hit[SMALL_GROUP];
    struct lighting light[SMALL_GROUP];
    struct surfaces surface[SMALL_GROUP];
    vfloat reach[SMALL_GROUP];
    trace_packets(rays, bounce, world, hit, light, surface, reach, result);
}

void trace(const struct ray_group *rays, int bounce, struct trace_context *world,
           struct shaded *result) {
    if (packets_in(world->group) == SMALL_GROUP)
        trace_few(rays, bounce, world, result);
    else
        trace_many(rays, bounce, world, result);
}
