// Rays to the light, as a packet each: soft shadows and hard ones.
#include "cones/tile_cones.h"
#include "march/march_step.h"
#include "simd/point.h"

// Rays to the light.
struct shadow_state {
    vfloat least_sq; // of the light so far: the root is taken once, of what is left in the end
    vfloat twice_previous;
    struct bounds_exit exit;
};

// The rays that are still under way, after some have ended.
__attribute__((noinline)) static bool end_shadow_rays(int k, vmask live,
                                                      struct packet_group *group) {
    group->live[k] = live;
    group->high[k] = v_select(live, group->high[k], v_splat(-INFINITY));
    return v_any(live);
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds. False after the
// packet's last step.
static inline bool soft_step(struct shadow_state *ray, int k, float strength_sq,
                             struct packet_group *group, const struct model *model) {
    vmask live = group->live[k];
    ACTIVE(v_count(live));
    COUNT(soft_step, call);
    vfloat t = group->t[k], h = group->distance[k], zero = v_splat(0.0f);
    vmask going = v_cmp_nlt_in(live, h, min_step(t, v_splat((float)model->march.hit_distance)));
    if (!v_any(going))
        return end_shadow_rays(k, going, group);
    ACTIVE(v_count(going));
    COUNT(soft_step, step);
    // y = h²/(2·previous); inside = h² − y², past = t − y. Asked without a division: both times 2·previous.
    vfloat twice = ray->twice_previous;
    vfloat square = h * h, scale = twice * twice, inside = scale - square;
    vfloat past = v_msub(twice, t, square);
    // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
    // In float it is noise wherever inside/h² is of the order of h's own error, 1e-5 at least.
    vmask sound = v_cmp_lt_in(v_cmp_lt_in(going, scale * v_splat(2e-5f), inside), zero, past);
    // (strength·h·√inside/past)² < least², asked without the division: it is seldom so.
    vfloat term = v_splat(strength_sq) * square * inside, per = past * past;
    vmask darker = v_cmp_lt_in(sound, term, ray->least_sq * per);
    if (v_any(darker)) {
        ACTIVE(v_count(darker));
        COUNT(soft_step, darker);
        ray->least_sq = v_select(darker, term / past / past, ray->least_sq); // past² may overflow
    }
    ray->twice_previous = h + h;
    group->t[k] = t = v_add_where(going, t, h);
    vmask on = v_cmp_ngt_in(going, outside_of_bounds(ray->exit, t), zero);
    return v_same(on, live) || end_shadow_rays(k, on, group);
}

static inline bool hard_step(struct shadow_state *ray, vfloat distance, int k,
                             struct packet_group *group, const struct model *model) {
    // Past the light a ray is lit, and has taken one evaluation too many.
    ACTIVE(v_count(group->live[k]));
    COUNT(hard_step, call);
    vfloat t = group->t[k], h = group->distance[k];
    vmask live = group->live[k], before = v_cmp_lt_in(live, t, distance);
    vmask going = v_cmp_nlt_in(before, h, min_step(t, v_splat((float)model->march.hit_distance)));
    ray->least_sq = v_zero_where(v_andnot(going, before), ray->least_sq);
    group->t[k] = t = v_add_where(going, t, h);
    vmask on = v_cmp_ngt_in(going, outside_of_bounds(ray->exit, t), v_splat(0.0f));
    return v_same(on, live) || end_shadow_rays(k, on, group);
}

// The list of what shadow rays can meet, and their origins in the frames of that.
static void list_occluders(const struct hit *hit, const struct lighting *light,
                           struct trace_context *world) {
    struct packet_group *group = &world->group;
    struct point origin[GROUP];
    struct vec direction[GROUP];
    vmask active[GROUP];
    const struct ray_group rays = {origin, direction, active, v_splat(0.0f)};
    vfloat length[GROUP];
    vmask lit = v_mask_none();
    for (int k = 0; k < world->group.size; k++) {
        rays.origin[k] = hit[k].point;
        rays.direction[k] = light[k].to_light;
        rays.active[k] = group->live[k];
        lit = v_or(lit, group->live[k]);
        length[k] = light[k].distance;
    }
    if (!v_any(lit))
        return;
    bool soft = world->scene->model.shadows == SHADOWS_SOFT;
    list_for_bundle(&rays, soft ? NULL : length, soft ? LIST_NEAREST : LIST_HIT, world,
                    world->own->shadow);
    for (int k = 0; k < world->group.size; k++)
        if (v_any(rays.active[k]))
            approach_origins(hit[k].point, world->scene, &group->beam[k]);
}

void shadow(const struct hit *hit, const struct lighting *light, struct trace_context *world,
            vfloat *reach) {
    COUNT(shadow, call);
    COUNT(shadow, scalar);
    const struct model *model = &world->scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct packet_group *group = &world->group;
    bool soft = model->shadows == SHADOWS_SOFT;
    struct shadow_state rays[GROUP];
    for (int k = 0; k < world->group.size; k++) {
        rays[k].least_sq = v_splat(1.0f);
        group->live[k] = model->shadows == SHADOWS_NONE ? v_mask_none() : light[k].lit;
    }
    list_occluders(hit, light, world);
    start_packets(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(v_count(light[k].lit));
        approach_directions(light[k].to_light, world->scene, &group->beam[k]);
        rays[k].exit = bounds_exit_of(hit[k].point, light[k].to_light, model);
        rays[k].twice_previous =
            v_splat(1e14f); // its square, times t's and the strength's, is a float
        group->t[k] = v_splat((float)model->march.surface_offset);
    }
    struct sole_shape alone = {.shape = -1};
    for (int step = 0; group->count > 0 && step < model->march.max_steps; step++) {
        scene_distances(group, world->scene, &alone);
        for (int i = 0; i < group->count;) {
            int k = group->list[i];
            if (soft ? soft_step(&rays[k], k, strength_sq, group, model)
                     : hard_step(&rays[k], light[k].distance, k, group, model))
                i++;
            else
                group->list[i] = group->list[--group->count];
        }
    }
    for (int k = 0; k < world->group.size; k++) {
        ACTIVE(v_count(light[k].lit));
        COUNT(shadow, end);
        reach[k] = v_sqrt(rays[k].least_sq);
    }
}
