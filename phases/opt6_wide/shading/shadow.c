// Soft and hard shadows: one packet of shadow rays for each packet of hits.
#include "core/sdf.h"
#include "core/trace.h"
#include "core/trace_context.h"
#include "shading/shadow_step.h"

void shadow(const struct hit *hit, const struct lighting *light, struct trace_context *world,
            vfloat *reach) {
    struct packet_group *group = world->group;
    bool none = world->scene->model.shadows == SHADOWS_NONE;
    struct shadow_state rays[GROUP];
    vfloat distance[GROUP];
    for (int k = 0; k < GROUP; k++) {
        distance[k] = light[k].distance;
        group->live[k] = none ? v_mask_none() : light[k].front;
    }
    start_packets(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        begin_shadow(&rays[k], k, hit[k].point, light[k].to_light, world);
    }
    march_shadows(rays, distance, world, reach);
}
