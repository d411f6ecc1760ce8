// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing of implicit
// surfaces", The Visual Computer 12 (1996). A packet marches until its last ray is done.
#include "march/march.h"
#include "core/sdf.h"
#include "march/march_single.h"

// Whether every live ray hits the plane `sole->shape` before any other shape can wake. Up to the plane, distance + t is
// at most the ray's t on the plane, origin/−direction. That quotient is taken 2^-16 too large, 256 times the rounding
// errors of the quotient and of the steps.
static bool plane_is_sole_hit(const struct packet_group *group, const struct sole_shape *sole) {
    bool falls = true;
    for (int i = 0; i < group->count && falls; i++) {
        int k = group->marching[i];
        const struct local_ray *a = &group->packet[k].local[sole->shape];
        vfloat down = v_splat(0.0f) - a->direction.x;
        vmask on = v_cmp_lt_in(group->live[k], v_splat(0.0f), down);
        on = v_cmp_lt_in(on, a->origin.x / down * v_splat(1.0f + 0x1p-16f), sole->until[k]);
        falls = v_same(on, group->live[k]);
    }
    return falls;
}

// The hit test is min_step()'s, which widens with t as a float's error does.
void march(struct march_state *packets, const struct ray_group *rays, struct trace_context *world) {
    const struct prepared *scene = world->scene;
    struct packet_group *group = world->group;
    start_packets(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        begin_march(&packets[k], k, rays, group, &scene->model);
    }
    struct shape_list list = group->packet[0].list;
    if (list.count == 1 && scene->primitives[*list.shape].eval == EVAL_LINEAR) {
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
        if (anew && sole.shape >= 0 && scene->primitives[sole.shape].eval == EVAL_LINEAR &&
            plane_is_sole_hit(group, &sole)) {
            march_to_plane(packets, sole.shape, step + 1, group, &scene->model);
            return;
        }
    }
}
