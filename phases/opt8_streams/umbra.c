// Shadow rays that wait, in packets: see streams.h. Each of them marches until its last ray is done.
#include "umbra.h"
#include "bounds.h"

static void wait_for(struct rays *rays, real length[GROUP], int first, struct desk *desk) {
    COUNT(wait_for, call);
    float (*field)[ROOM] = desk->shadow;
    for (int k = 0; k < GROUP; k++, first += LANES) {
        rays->origin[k] =
            (struct place){load_vec(field + S_HI, first), load_vec(field + S_LO, first)};
        rays->direction[k] = load_vec(field + S_TO_LIGHT, first);
        COUNT(wait_for, packet);
        rays->active[k] = lanes_before(desk->shadows - first);
        length[k] = load(&field[S_DISTANCE][first]);
    }
}

// 1: the light reaches the point, 0: it does not; between, the penumbra of a soft shadow.
static void shadow(const struct rays *rays, const real length[GROUP], struct world *world,
                   real reach[GROUP]) {
    COUNT(shadow, call);
    COUNT(shadow, scalar);
    const struct prepared *scene = world->scene;
    const struct model *model = &scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct group *group = &world->group;
    bool soft = model->shadows == SHADOWS_SOFT;
    struct shade shades[GROUP];
    meet(rays, soft ? NULL : length, soft ? UNION : HIT, world, world->own->shadow);
    for (int k = 0; k < GROUP; k++) {
        shades[k].least_sq = set(1.0f);
        group->live[k] = rays->active[k];
        if (any(rays->active[k]))
            approach_origins(rays->origin[k], scene, &group->beam[k]);
    }
    set_out(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(count_of(rays->active[k]));
        approach_directions(rays->direction[k], scene, &group->beam[k]);
        shades[k].exit = leaving(rays->origin[k], rays->direction[k], model);
        shades[k].twice_previous =
            set(1e14f); // its square, times t's and the strength's, is a float
        group->t[k] = set((float)model->march.surface_offset);
    }
    struct alone alone = {.shape = -1};
    for (int step = 0; group->count > 0 && step < model->march.max_steps; step++) {
        scene_distances(group, scene, &alone);
        for (int i = 0; i < group->count;) {
            int k = group->list[i];
            mask live = group->live[k];
            mask on = soft ? soft_step(&shades[k], k, strength_sq, group, model)
                           : hard_step(&shades[k], length[k], k, group, model);
            if (same(on, live) || shade_ends(k, on, group))
                i++;
            else
                group->list[i] = group->list[--group->count];
        }
    }
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(count_of(rays->active[k]));
        COUNT(shadow, end);
        reach[k] = root(shades[k].least_sq);
    }
}

static void cast_packets(struct world *world) {
    COUNT(cast_packets, call);
    struct desk *desk = world->desk;
    for (int first = 0; first < desk->shadows; first += TOGETHER) {
        struct rays rays;
        real length[GROUP], reach[GROUP];
        wait_for(&rays, length, first, desk);
        shadow(&rays, length, world, reach);
        for (int k = 0; k < GROUP; k++) {
            int at = first + k * LANES;
            ACTIVE(count_of(rays.active[k]));
            COUNT(cast_packets, packet);
            struct vec light = vec_scale(load_vec(desk->shadow + S_LIGHT, at), reach[k]);
            add_light(rays.active[k], light, load(&desk->shadow[S_PIXEL][at]), desk);
        }
    }
}

void cast_shadows(struct world *world) {
    COUNT(cast_shadows, call);
    struct desk *desk = world->desk;
    if (world->scene->bulbs > 0)
        cast_streams(world);
    else
        cast_packets(world);
    desk->shadows = 0;
}
