// The ideal soft shadow: the least strength·h(t)/t up to the light, by a slow march.
#include "core/packet_group.h"
#include "core/sdf.h"
#include "shading/shadow_step.h"

#define ROOM (1.0f / 64)
#define LEAST_STEP 0x1p-16f // of t, for strengths that ask for less

// What the steps of all rays have in common. `lit`: the ratio h/t from which on a ray is lit.
struct ideal_limits {
    float strength, lit, room;
};

// Takes a step of packet k, of whose light `reach` is left. The distance h falls no faster than t grows. So no ratio
// h/t is below `goal` within the next (h − goal·t)/(1 + goal). The goal is so little below the least ratio found that the
// result is at most ROOM too light. At a smooth minimum the steps are about ROOM·t, so the error is about ROOM². A
// Mandelbulb's h is an estimate: nothing is proved there. Returns the rays that are still live.
static inline vmask ideal_step(vfloat *reach, vfloat distance, int k, struct ideal_limits limits,
                               struct packet_group *group) {
    vmask live = group->live[k];
    ACTIVE(v_count(live));
    COUNT(ideal_step, call);
    vfloat t = group->t[k], h = group->distance[k], zero = v_splat(0.0f);
    vmask before = v_cmp_ngt_in(live, t, distance);
    vfloat light = v_splat(limits.strength) * v_max(h / t, zero);
    *reach = v_select(before, v_min(*reach, light), *reach);
    vmask going = v_cmp_lt_in(v_cmp_gt_in(before, *reach, zero), t, distance);
    vfloat goal = v_msub(*reach, v_splat(limits.lit), v_splat(limits.room));
    vfloat step = v_max(v_nmadd(goal, t, h) / (v_splat(1.0f) + goal), v_splat(LEAST_STEP) * t);
    group->t[k] = v_select(going, v_min(t + step, distance), t);
    return going;
}

void ideal_shadow(const vfloat *distance, struct packet_group *group, const struct prepared *scene,
                  vfloat *reach) {
    float strength = (float)scene->model.shadow_strength, lit = 1.0f / strength;
    struct ideal_limits limits = {strength, lit, ROOM * (lit < 1.0f ? lit : 1.0f)};
    for (int k = 0; k < packets_in(group); k++)
        reach[k] = v_splat(1.0f);
    struct sole_shape sole = {.shape = -1};
    while (group->count > 0) {
        scene_distances(group, scene, &sole);
        for (int i = 0; i < group->count;) {
            int k = group->marching[i];
            vmask live = group->live[k], on = ideal_step(&reach[k], distance[k], k, limits, group);
            if (v_same(on, live) || end_shadow_rays(k, on, group))
                i++;
            else
                group->marching[i] = group->marching[--group->count];
        }
    }
}
