// From rays to hits: marches a group of packets, and places each hit on its surface.
#include "core/local_rays.h"
#include "march/march.h"

// Rays that march on from a hit are landed again, until all have landed.
void ray_march(const struct ray_group *rays, struct trace_context *world, struct hit *hit) {
    const struct prepared *scene = world->scene;
    struct packet_group *group = world->group;
    struct march_state packets[GROUP];
    unsigned going = 0;
    for (int k = 0; k < packets_in(group); k++) {
        packets[k] = march_state_of(rays, k, world);
        group->live[k] = rays->active[k];
        if (!v_any(rays->active[k]))
            continue;
        going |= 1u << k;
        set_local_origins(rays->origin[k], scene, &group->packet[k]);
        set_local_directions(rays->direction[k], scene, &group->packet[k]);
    }
    while (going) {
        vmask settled[GROUP];
        for (int k = 0; k < packets_in(group); k++)
            settled[k] = packets[k].found;
        march(packets, rays, world);
        for (int k = 0; k < packets_in(group); k++)
            if (going >> k & 1 && !land_hits(&packets[k], settled[k], rays->direction[k], scene,
                                             &group->packet[k], &group->live[k]))
                going &= ~(1u << k);
    }
    struct hit_normal normal;
    for (int k = 0; k < packets_in(group); k++)
        hit[k] = finish_hit(&packets[k], rays->direction[k], scene, &group->packet[k], &normal);
}
