// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing of implicit
// surfaces", The Visual Computer 12 (1996). A packet marches until its last ray is done.
#include "core/packet_group.h"
#include "core/sdf.h"
#include "march/march_single.h"
#include "march/march_state.h"

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
    end_rays(at, step, k, going, inside, group, march_cap(at, model));
    return v_any(group->live[k]);
}

// The hit test is min_step()'s, which widens with t as a float's error does.
void march(struct march_state *packets, const struct ray_group *rays, struct trace_context *world) {
    const struct prepared *scene = world->scene;
    struct packet_group *group = world->group;
    start_packets(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        struct march_state *at = &packets[k];
        at->exit = bounds_exit_of(at->origin, rays->direction[k], &scene->model);
        at->left = steps_left(at, group->live[k], march_cap(at, &scene->model));
        group->t[k] = first_t(at, group->live[k]);
        at->last = v_zero_where(group->live[k], at->last);
    }
    struct shape_list list = group->packet[0].list;
    if (list.count == 1 && scene->primitives[*list.shape].kind == EVAL_LINEAR) {
        march_to_plane(packets, *list.shape, 1, group, &scene->model);
        return;
    }
    if (list.count == 1 && march_solid(packets, *list.shape, group, scene))
        return;
    struct sole_shape sole = {.shape = -1};
    for (int step = 1; group->count > 0; step++) {
        bool anew = scene_distances(group, scene, &sole);
        for (int i = 0; i < group->count;) {
            int k = group->marching[i];
            if (march_step(&packets[k], step, k, group, &scene->model)) {
                i++;
                continue;
            }
            packets[k].t = group->t[k];
            group->marching[i] = group->marching[--group->count];
        }
        if (anew && sole.shape >= 0 && scene->primitives[sole.shape].kind == EVAL_LINEAR &&
            plane_is_sole_hit(group, &sole)) {
            march_to_plane(packets, sole.shape, step + 1, group, &scene->model);
            return;
        }
    }
}
