// From rays to hits: marches a group of packets, and places each hit on its surface.
#include "core/local_rays.h"
#include "core/packet_group.h"
#include "core/ray_queues.h"
#include "march/march_state.h"

// Finds the shape that a ray of `deep` was in when its march ended. It is found here because the step back may bring the
// ray nearer to another shape.
__attribute__((noinline)) static void shape_inside(vmask deep, vfloat t,
                                                   const struct prepared *scene,
                                                   const struct packet_rays *packet,
                                                   vfloat *shape) {
    vfloat inside = v_splat(-1.0f);
    nearest_shape_at(packet, t, scene, deep, &inside);
    *shape = v_select(deep, inside, *shape);
}

// Makes each hit the origin of its ray in the frames of all shapes, where a distance is rounded at a shape's size. A
// hit further than twice the hit distance from any shape marches on. Returns whether there is one. Hits in `settled`
// were landed by an earlier call.
static bool land_hits(struct march_state *at, vmask settled, struct vec direction,
                      const struct prepared *scene, struct packet_rays *packet, vmask *live) {
    if (!v_any(at->found))
        return false;
    float twice = 2.0f * (float)scene->model.march.hit_distance;
    vmask sunk = v_and(v_andnot(settled, at->found), v_cmp_lt(at->last, v_splat(-twice)));
    if (v_any(sunk))
        shape_inside(sunk, at->t, scene, packet, &at->inside);
    at->deep = v_or(at->deep, sunk);
    // A settled hit keeps every bit, whatever its neighbours in the packet do.
    at->origin =
        point_select(settled, at->origin, point_at(at->origin, direction, at->t, at->last));
    set_local_origins(at->origin, scene, packet);
    if (scene->groups && !v_any(settled))
        recall_regions(at->t + at->last, scene, packet);
    at->near = near_hit(at->found, scene, packet);
    vmask unsettled = v_andnot(v_or(at->exact, v_or(at->deep, settled)), at->found);
    vmask off = v_and(unsettled, v_cmp_gt(at->near.distance, v_splat(twice)));
    if (!v_any(off))
        return false;
    // The ray restarts a few ulps of t earlier, surely before the surface, however thin the shape is.
    vfloat back = v_select_or_zero(off, at->t * v_splat(-0x1p-22f));
    at->origin.lo = vec_along(at->origin.lo, direction, back);
    at->before = v_select(off, at->before + (at->t + (at->last + back)), at->before);
    set_local_origins(at->origin, scene, packet);
    set_local_directions(direction, scene, packet);
    at->found = v_andnot(off, at->found);
    *live = v_cmp_lt_in(off, at->evals, v_splat((float)step_cap(&scene->model)));
    return v_any(*live);
}

// Returns the hits once all have landed: distance, place, normal and shape, after Newton's last step.
static struct hit finish_hit(struct march_state *at, struct vec direction,
                             const struct prepared *scene, struct packet_rays *packet) {
    struct hit hit = {.found = at->found, .shape = v_splat(-1.0f), .evals = at->evals};
    hit.smooth = v_mask_none();
    if (!v_any(at->found))
        return hit;
    vfloat path = at->before + at->t;
    // A ray that has not moved starts at or in a shape. It hits it there, even outside of the bounds.
    vmask unmoved = v_cmp_ge(v_splat(0.0f), path);
    hit.found = v_and(hit.found, v_or(within(at->origin, &scene->model), unmoved));
    struct hit_surroundings near = at->near;
    if (v_any(at->deep)) {
        vmask other = v_cmp_ge(v_abs(near.shape - at->inside), v_splat(0.5f));
        near.contact = v_or(near.contact, v_and(at->deep, other));
        near.shape = v_select(at->deep, at->inside, near.shape);
    }
    struct hit_normal at_hit = normal_at(direction, hit.found, &near, scene, packet);
    hit.normal = at_hit.normal;
    vmask gradient = v_cmp_lt_in(hit.found, at_hit.slope, v_splat(2.0f));
    hit.smooth = v_andnot(v_or(at->deep, v_or(at_hit.inward, near.contact)), gradient);
    hit.shape = v_select(hit.found, near.shape, hit.shape);
    vfloat more = v_zero_where(at->deep, newton(near.distance, at_hit.slope, path));
    hit.t = at->before + (at->t + (at->last + more));
    hit.point = at->origin;
    hit.point.lo = vec_along(hit.point.lo, direction, more);
    move_local_origins(more, scene, packet);
    return hit;
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
    for (int k = 0; k < GROUP; k++)
        hit[k] = finish_hit(&packets[k], rays->direction[k], scene, &group->packet[k]);
}
