// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing of implicit
// surfaces", The Visual Computer 12 (1996). A packet marches until its last ray is done.
#include "march/march.h"
#include "core/sdf.h"

// The hit test is min_step()'s, which widens with t as a float's error does.
void march(struct march_state *packets, const struct ray_group *rays, struct trace_context *world) {
    const struct prepared *scene = world->scene;
    struct packet_group *group = world->group;
    start_packets(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        begin_march(&packets[k], k, rays, group, &scene->model);
    }
    struct sole_shape sole = {.shape = -1};
    for (int step = 1; group->count > 0; step++) {
        scene_distances(group, scene, &sole);
        for (int i = 0; i < group->count;) {
            int k = group->marching[i];
            if (march_step(&packets[k], step, k, group, &scene->model)) {
                i++;
                continue;
            }
            packets[k].t = group->t[k];
            group->marching[i] = group->marching[--group->count];
        }
    }
}
