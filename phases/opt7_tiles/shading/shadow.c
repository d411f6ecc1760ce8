// Soft and hard shadows: one packet of shadow rays for each packet of hits.
#include "cones/march_scratch.h"
#include "cones/tile_cones.h"
#include "core/local_rays.h"
#include "core/sdf.h"
#include "core/trace.h"
#include "core/trace_context.h"
#include "shading/shadow_step.h"

// Lists the shapes that the shadow rays can meet, and sets the rays' origins in the frames of these shapes.
static void list_occluders(const struct hit *hit, const struct lighting *light,
                           const vfloat *length, struct trace_context *world) {
    struct packet_group *group = world->group;
    struct point origin[GROUP];
    struct vec direction[GROUP];
    vmask active[GROUP];
    const struct ray_group rays = {origin, direction, active, v_splat(0.0f)};
    vmask front = v_mask_none();
    for (int k = 0; k < packets_in(group); k++) {
        rays.origin[k] = hit[k].point;
        rays.direction[k] = light[k].to_light;
        rays.active[k] = group->live[k];
        front = v_or(front, group->live[k]);
    }
    if (!v_any(front))
        return;
    enum shadows shadows = world->scene->model.shadows;
    list_for_bundle(&rays, shadows == SHADOWS_SOFT ? NULL : length,
                    shadows == SHADOWS_HARD ? LIST_HIT : LIST_NEAREST, world,
                    world->scratch->shadow);
    for (int k = 0; k < packets_in(group); k++)
        if (v_any(rays.active[k]))
            set_local_origins(hit[k].point, world->scene, &group->packet[k]);
}

void shadow(const struct hit *hit, const struct lighting *light, struct trace_context *world,
            vfloat *reach) {
    struct packet_group *group = world->group;
    bool none = world->scene->model.shadows == SHADOWS_NONE;
    struct shadow_state rays[GROUP];
    vfloat distance[GROUP];
    for (int k = 0; k < packets_in(group); k++) {
        distance[k] = light[k].distance;
        group->live[k] = none ? v_mask_none() : light[k].front;
    }
    list_occluders(hit, light, distance, world);
    start_packets(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        begin_shadow(&rays[k], k, hit[k].point, light[k].to_light, world);
    }
    march_shadows(rays, distance, world, reach);
}
