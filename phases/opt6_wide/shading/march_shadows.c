// Marches the shadow rays of a group of packets.
#include "core/local_rays.h"
#include "core/sdf.h"
#include "core/trace_context.h"
#include "shading/shadow_step.h"

void begin_shadow(struct shadow_state *ray, int k, struct point origin, struct vec to_light,
                  struct trace_context *world) {
    const struct model *model = &world->scene->model;
    set_local_directions(to_light, world->scene, &world->group->packet[k]);
    ray->exit = bounds_exit_of(origin, to_light, model);
    ray->twice_previous = v_splat(1e14f); // its square times t² and strength² is still a float
    world->group->t[k] = v_splat((float)model->march.surface_offset);
}

void march_shadows(struct shadow_state *rays, const vfloat *distance, struct trace_context *world,
                   vfloat *reach) {
    const struct model *model = &world->scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct packet_group *group = world->group;
    bool soft = model->shadows == SHADOWS_SOFT;
    if (model->shadows == SHADOWS_IDEAL) {
        ideal_shadow(distance, group, world->scene, reach);
        return;
    }
    for (int k = 0; k < packets_in(group); k++)
        rays[k].least_sq = v_splat(1.0f);
    struct sole_shape sole = {.shape = -1};
    for (int step = 0; group->count > 0 && step < model->march.max_steps; step++) {
        scene_distances(group, world->scene, &sole);
        for (int i = 0; i < group->count;) {
            int k = group->marching[i];
            vmask live = group->live[k];
            vmask on = soft ? soft_step(&rays[k], k, strength_sq, group, model)
                            : hard_step(&rays[k], distance[k], k, group, model);
            if (v_same(on, live) || end_shadow_rays(k, on, group))
                i++;
            else
                group->marching[i] = group->marching[--group->count];
        }
    }
    for (int k = 0; k < packets_in(group); k++)
        reach[k] = v_sqrt(rays[k].least_sq);
}
