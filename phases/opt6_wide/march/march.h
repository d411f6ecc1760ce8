// A packet's march: how it begins, a step, and its end.
#pragma once

#include "core/packet_group.h"
#include "core/trace.h"
#include "core/trace_context.h"
#include "march/march_step.h"

#include "march/march_state.h" // needs the others

// Ends the rays of packet k that have left `going` (at a surface) or `inside` (the bounds), and those that have used
// up their steps, whatever their neighbours had. `step` counts from 1.
void end_rays(struct march_state *at, int step, int k, vmask going, vmask inside,
              struct packet_group *group, int cap);

// Marches the live rays of the group until every one has ended.
void march(struct march_state *packets, const struct ray_group *rays, struct trace_context *world);

// Makes each hit the origin of its ray, in the frames of all shapes. There a distance is rounded at the size of a
// shape, not of the path to it. A hit may still be further than twice the hit distance from any shape: the march has
// rounding errors, and its test may be wider than the scene's. Such a ray marches on. Returns whether there is one.
// Hits in `settled` were landed by an earlier call.
bool land_hits(struct march_state *at, vmask settled, struct vec direction,
               const struct prepared *scene, struct packet_rays *packet, vmask *live);

// Returns the hits once all have landed: distance, place, normal and shape, after Newton's last step.
// `at_hit` is set where there is a hit.
struct hit finish_hit(struct march_state *at, struct vec direction, const struct prepared *scene,
                      struct packet_rays *packet, struct hit_normal *at_hit);

// Begins the march of packet k. Rays that march on from a hit have used some of their steps.
static inline void begin_march(struct march_state *at, int k, const struct ray_group *rays,
                               struct packet_group *group, const struct model *model) {
    vmask live = group->live[k];
    at->exit = bounds_exit_of(at->origin, rays->direction[k], model);
    at->left = at->cap + (int)v_reduce_min(v_select_or_zero(live, v_splat(0.0f) - at->evals));
    group->t[k] = first_t(at, live);
    at->last = v_zero_where(live, at->last);
}

// Takes a packet's step number `step`, with its distance known. Returns false if no ray of the packet is left.
static inline bool march_step(struct march_state *at, int step, int k, struct packet_group *group,
                              const struct model *model) {
    vmask live = group->live[k];
    ACTIVE(v_count(live));
    COUNT(march_step, call);
    vfloat t = group->t[k], distance = group->distance[k];
    vmask going =
        v_cmp_nlt_in(live, distance, min_step(t, v_splat((float)model->march.hit_distance)));
    group->t[k] = t = v_add_where(going, t, distance);
    vmask inside = v_cmp_ngt_in(going, outside_of_bounds(at->exit, t), v_splat(0.0f));
    if (v_same(inside, live) && step < at->left)
        return true;
    end_rays(at, step, k, going, inside, group, at->cap);
    return v_any(group->live[k]);
}
