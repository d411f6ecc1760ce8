// Marches the queued shadow rays in packets: see core/ray_queues.h. Each packet marches until its last ray is done.
#include "cones/march_scratch.h"
#include "cones/tile_cones.h"
#include "core/local_rays.h"
#include "core/ray_queues.h"
#include "core/sdf.h"
#include "core/trace_context.h"
#include "shading/shadow_step.h"

static void load_shadow_group(struct ray_group *rays, vfloat length[GROUP], int first,
                              struct ray_queues *queues) {
    float (*field)[QUEUE_ROOM] = queues->shadow;
    for (int k = 0; k < GROUP; k++, first += LANES) {
        rays->origin[k] =
            (struct point){load_vec(field + S_HI, first), load_vec(field + S_LO, first)};
        rays->direction[k] = load_vec(field + S_TO_LIGHT, first);
        rays->active[k] = lanes_until(queues->shadows - first);
        length[k] = v_load(&field[S_DISTANCE][first]);
    }
}

static void shadow(const struct ray_group *rays, const vfloat length[GROUP],
                   struct trace_context *world, vfloat reach[GROUP]) {
    enum shadows shadows = world->scene->model.shadows;
    struct packet_group *group = world->group;
    struct shadow_state shades[GROUP];
    list_for_bundle(rays, shadows == SHADOWS_SOFT ? NULL : length,
                    shadows == SHADOWS_HARD ? LIST_HIT : LIST_NEAREST, world,
                    world->scratch->shadow);
    for (int k = 0; k < GROUP; k++) {
        group->live[k] = rays->active[k];
        if (v_any(rays->active[k]))
            set_local_origins(rays->origin[k], world->scene, &group->packet[k]);
    }
    start_packets(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        begin_shadow(&shades[k], k, rays->origin[k], rays->direction[k], world);
    }
    march_shadows(shades, length, world, reach);
}

static void cast_packets(struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    for (int first = 0; first < queues->shadows; first += GROUP_RAYS) {
        struct ray_group rays;
        vfloat length[GROUP], reach[GROUP];
        load_shadow_group(&rays, length, first, queues);
        shadow(&rays, length, world, reach);
        for (int k = 0; k < GROUP; k++) {
            int at = first + k * LANES;
            struct vec light = vec_scale(load_vec(queues->shadow + S_LIGHT, at), reach[k]);
            add_light(rays.active[k], light, v_load(&queues->shadow[S_PIXEL][at]), queues);
        }
    }
}

void cast_shadows(struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    if (world->scene->bulbs > 0 && world->scene->model.shadows != SHADOWS_IDEAL)
        cast_streams(world);
    else
        cast_packets(world);
    queues->shadows = 0;
}
