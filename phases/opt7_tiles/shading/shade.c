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
                   const struct materials *surface, struct shaded *result) {
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
                                 struct lighting *light, struct materials *surface, vfloat *reach,
                                 struct shaded *result) {
    const struct model *model = &world->scene->model;
    const int size = packets_in(world->group);
    light_hits(rays, size, world, hit, light, surface, reach, result);
    if (model->features.mirrors && bounce < model->march.max_bounces)
        for (int first = 0; first < size; first += SMALL_GROUP) {
            const struct ray_group some = {rays->origin + first, rays->direction + first,
                                           rays->active + first, rays->start};
            mirror(&some, bounce, world, surface + first, result + first);
        }
    add_fog(size, model, result);
}

// A large group holds camera rays only, so the recursion's arrays stay small and every bounce fits the stack.
__attribute__((noinline)) static void trace_many(const struct ray_group *rays, int bounce,
                                                 struct trace_context *world,
                                                 struct shaded *result) {
    struct hit hit[GROUP];
    struct lighting light[GROUP];
    struct materials surface[GROUP];
    vfloat reach[GROUP];
    trace_packets(rays, bounce, world, hit, light, surface, reach, result);
}

__attribute__((noinline)) static void trace_few(const struct ray_group *rays, int bounce,
                                                struct trace_context *world,
                                                struct shaded *result) {
    struct hit hit[SMALL_GROUP];
    struct lighting light[SMALL_GROUP];
    struct materials surface[SMALL_GROUP];
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
