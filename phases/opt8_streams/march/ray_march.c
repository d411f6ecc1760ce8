// From rays to hits: marches a group of packets, and places each hit on its surface.
#include "core/local_rays.h"
#include "core/ray_queues.h"
#include "march/march.h"

// Returns the hits whose normal is a closed form and points out of the shape.
static vmask smooth_hits(const struct march_state *at, const struct hit *hit,
                         const struct hit_normal *at_hit) {
    if (!v_any(at->found))
        return v_mask_none();
    vmask gradient = v_cmp_lt_in(hit->found, at_hit->slope, v_splat(2.0f));
    return v_andnot(v_or(at->deep, v_or(at_hit->inward, at->near.contact)), gradient);
}

// Takes the rays from where bulb/bulb_stream.c or bulb/bulb_single.c has left them. Rays that have ended there are done.
// The others have no Mandelbulb before them any more, and march on among the other shapes.
static void resume_march(struct march_state packets[GROUP], const struct ray_group *rays,
                         struct trace_context *world) {
    const struct ray_queues *queues = world->queues;
    struct packet_group *group = world->group;
    struct shape_list all = group->packet[0].list;
    for (int k = 0, slot = rays->marched; k < GROUP; k++, slot += LANES) {
        struct march_state *at = &packets[k];
        vfloat found = v_load(&queues->marched[MARCH_FOUND][slot]);
        vmask over = v_and(rays->active[k], v_cmp_ge(found, v_splat(0.0f)));
        at->t = v_select_or_zero(rays->active[k], v_load(&queues->marched[MARCH_T][slot]));
        at->start = v_zero_where(over, at->t);
        at->last = v_select_or_zero(over, v_load(&queues->marched[MARCH_LAST_STEP][slot]));
        at->evals = v_select_or_zero(rays->active[k], v_load(&queues->marched[MARCH_EVALS][slot]));
        at->found = v_and(over, v_cmp_gt(found, v_splat(0.5f)));
        at->exact = world->single_bulb ? at->found : v_mask_none();
        group->live[k] = v_andnot(over, rays->active[k]);
        group->packet[k].list = rays->others;
    }
    march(packets, rays, world);
    for (int k = 0; k < GROUP; k++)
        group->packet[k].list = all;
}

// Marches the rays of the group and returns their hits. Rays that marched on from a hit are landed again until all are.
void ray_march(const struct ray_group *rays, struct trace_context *world, struct hit *hit) {
    const struct prepared *scene = world->scene;
    struct packet_group *group = world->group;
    struct march_state packets[GROUP];
    unsigned going = 0;
    bool recalled = rays->marched < 0;
    for (int k = 0; k < GROUP; k++) {
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
        for (int k = 0; k < GROUP; k++)
            settled[k] = packets[k].found;
        if (recalled)
            march(packets, rays, world);
        else
            resume_march(packets, rays, world);
        recalled = true;
        for (int k = 0; k < GROUP; k++)
            if (going >> k & 1 && !land_hits(&packets[k], settled[k], rays->direction[k], scene,
                                             &group->packet[k], &group->live[k]))
                going &= ~(1u << k);
    }
    for (int k = 0; k < GROUP; k++) {
        struct hit_normal normal;
        hit[k] = finish_hit(&packets[k], rays->direction[k], scene, &group->packet[k], &normal);
        hit[k].smooth = smooth_hits(&packets[k], &hit[k], &normal);
    }
}
