// Marches the queued shadow rays in packets: see core/ray_queues.h. Each packet marches until its last ray is done.
#include "cones/march_scratch.h"
#include "cones/tile_cones.h"
#include "core/local_rays.h"
#include "core/ray_queues.h"
#include "core/sdf.h"
#include "core/trace_context.h"
#include "shading/ideal_shadow.h"
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

// Returns how much of the light reaches each origin: 1 lit, 0 in shadow, between them the penumbra of a soft shadow.
static void shadow(const struct ray_group *rays, const vfloat length[GROUP],
                   struct trace_context *world, vfloat reach[GROUP]) {
    const struct prepared *scene = world->scene;
    const struct model *model = &scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct packet_group *group = world->group;
    bool soft = model->shadows == SHADOWS_SOFT;
    struct shadow_state shades[GROUP];
    list_for_bundle(rays, soft ? NULL : length,
                    model->shadows == SHADOWS_HARD ? LIST_HIT : LIST_NEAREST, world,
                    world->scratch->shadow);
    for (int k = 0; k < GROUP; k++) {
        shades[k].least_sq = v_splat(1.0f);
        group->live[k] = rays->active[k];
        if (v_any(rays->active[k]))
            set_local_origins(rays->origin[k], scene, &group->packet[k]);
    }
    start_packets(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        set_local_directions(rays->direction[k], scene, &group->packet[k]);
        shades[k].exit = bounds_exit_of(rays->origin[k], rays->direction[k], model);
        shades[k].twice_previous =
            v_splat(1e14f); // its square times t² and strength² is still a float
        group->t[k] = v_splat((float)model->march.surface_offset);
    }
    if (model->shadows == SHADOWS_IDEAL) {
        ideal_shadow(length, group, scene, reach);
        return;
    }
    struct sole_shape sole = {.shape = -1};
    for (int step = 0; group->count > 0 && step < model->march.max_steps; step++) {
        scene_distances(group, scene, &sole);
        for (int i = 0; i < group->count;) {
            int k = group->marching[i];
            vmask live = group->live[k];
            vmask on = soft ? soft_step(&shades[k], k, strength_sq, group, model)
                            : hard_step(&shades[k], length[k], k, group, model);
            if (v_same(on, live) || end_shadow_rays(k, on, group))
                i++;
            else
                group->marching[i] = group->marching[--group->count];
        }
    }
    for (int k = 0; k < GROUP; k++)
        reach[k] = v_sqrt(shades[k].least_sq);
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
