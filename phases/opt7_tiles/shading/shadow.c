// Soft and hard shadows: one packet of shadow rays for each packet of hits.
#include "cones/march_scratch.h"
#include "cones/tile_cones.h"
#include "core/local_rays.h"
#include "core/sdf.h"
#include "core/trace.h"
#include "core/trace_context.h"
#include "shading/ideal_shadow.h"
#include "shading/shadow_step.h"

// Lists the shapes that the shadow rays can meet, and sets the rays' origins in the frames of these shapes.
static void list_occluders(const struct hit *hit, const struct lighting *light,
                           struct trace_context *world) {
    struct packet_group *group = world->group;
    struct point origin[GROUP];
    struct vec direction[GROUP];
    vmask active[GROUP];
    const struct ray_group rays = {origin, direction, active, v_splat(0.0f)};
    vfloat length[GROUP];
    vmask lit = v_mask_none();
    for (int k = 0; k < packets_in(group); k++) {
        rays.origin[k] = hit[k].point;
        rays.direction[k] = light[k].to_light;
        rays.active[k] = group->live[k];
        lit = v_or(lit, group->live[k]);
        length[k] = light[k].distance;
    }
    if (!v_any(lit))
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
    const struct model *model = &world->scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct packet_group *group = world->group;
    bool soft = model->shadows == SHADOWS_SOFT;
    struct shadow_state rays[GROUP];
    for (int k = 0; k < packets_in(group); k++) {
        rays[k].least_sq = v_splat(1.0f);
        group->live[k] = model->shadows == SHADOWS_NONE ? v_mask_none() : light[k].lit;
    }
    list_occluders(hit, light, world);
    start_packets(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        set_local_directions(light[k].to_light, world->scene, &group->packet[k]);
        rays[k].exit = bounds_exit_of(hit[k].point, light[k].to_light, model);
        rays[k].twice_previous =
            v_splat(1e14f); // its square times t² and strength² is still a float
        group->t[k] = v_splat((float)model->march.surface_offset);
    }
    if (model->shadows == SHADOWS_IDEAL) {
        vfloat distance[GROUP];
        for (int k = 0; k < packets_in(group); k++)
            distance[k] = light[k].distance;
        ideal_shadow(distance, group, world->scene, reach);
        return;
    }
    struct sole_shape sole = {.shape = -1};
    for (int step = 0; group->count > 0 && step < model->march.max_steps; step++) {
        scene_distances(group, world->scene, &sole);
        for (int i = 0; i < group->count;) {
            int k = group->marching[i];
            vmask live = group->live[k];
            vmask on = soft ? soft_step(&rays[k], k, strength_sq, group, model)
                            : hard_step(&rays[k], light[k].distance, k, group, model);
            if (v_same(on, live) || end_shadow_rays(k, on, group))
                i++;
            else
                group->marching[i] = group->marching[--group->count];
        }
    }
    for (int k = 0; k < packets_in(group); k++)
        reach[k] = v_sqrt(rays[k].least_sq);
}
