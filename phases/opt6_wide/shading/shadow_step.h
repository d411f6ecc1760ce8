// One step of a packet of shadow rays, soft and hard.
#pragma once

#include "core/packet_group.h"
#include "march/march_step.h"

struct trace_context; // core/trace_context.h

// Makes the shadow rays of packet k ready. Their origins are set.
void begin_shadow(struct shadow_state *ray, int k, struct point origin, struct vec to_light,
                  struct trace_context *world);

// Sets how much of the light reaches each origin: 1 lit, 0 in shadow, between them the penumbra of a soft shadow.
// `distance` is the light's. The marching packets are ready.
void march_shadows(struct shadow_state *rays, const vfloat *distance, struct trace_context *world,
                   vfloat *reach);

// The same of the ideal soft shadow.
void ideal_shadow(const vfloat *distance, struct packet_group *group, const struct prepared *scene,
                  vfloat *reach);

// Keeps the rays `live` of packet k. Returns whether there are any.
__attribute__((noinline, unused)) static bool end_shadow_rays(int k, vmask live,
                                                              struct packet_group *group) {
    group->live[k] = live;
    group->high[k] = v_select(live, group->high[k], v_splat(-INFINITY));
    return v_any(live);
}

// Takes a step of the improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs"
// (iquilezles.org/articles/rmshadows), after S. Aaltonen's GDC 2018 talk. The march goes past the light to the bounds.
// Returns the rays that are still live after this step. The state of all other rays is unchanged.
static inline vmask soft_step(struct shadow_state *ray, int k, float strength_sq,
                              struct packet_group *group, const struct model *model) {
    vmask live = group->live[k];
    ACTIVE(v_count(live));
    COUNT(soft_step, call);
    vfloat t = group->t[k], h = group->distance[k], zero = v_splat(0.0f);
    vmask going = v_cmp_nlt_in(live, h, min_step(t, v_splat((float)model->march.hit_distance)));
    if (!v_any(going))
        return going;
    // y = h²/(2·previous); inside = h² − y², past = t − y. Both are scaled by 2·previous to save a division.
    vfloat twice = ray->twice_previous;
    vfloat square = h * h, scale = twice * twice, inside = scale - square;
    vfloat past = v_msub(twice, t, square);
    // Moving straight away from a surface gives 0/0 (h = 2·previous): no term. In float, the term is noise where
    // inside/h² is of the order of h's error, at least 1e-5.
    vmask sound = v_cmp_lt_in(v_cmp_lt_in(going, scale * v_splat(2e-5f), inside), zero, past);
    // (strength·h·√inside/past)² < least², without the division: it is seldom true.
    vfloat term = v_splat(strength_sq) * square * inside, per = past * past;
    vmask darker = v_cmp_lt_in(sound, term, ray->least_sq * per);
    if (v_any(darker))
        ray->least_sq = v_select(darker, term / past / past, ray->least_sq); // past² may overflow
    ray->twice_previous = v_select(going, h + h, twice);
    group->t[k] = t = v_add_where(going, t, h);
    return v_cmp_ngt_in(going, outside_of_bounds(ray->exit, t), zero);
}

// Takes a step of a hard shadow. Returns the rays that are still live.
static inline vmask hard_step(struct shadow_state *ray, vfloat distance, int k,
                              struct packet_group *group, const struct model *model) {
    // A ray past the light is lit. It has taken one evaluation too many.
    ACTIVE(v_count(group->live[k]));
    COUNT(hard_step, call);
    vfloat t = group->t[k], h = group->distance[k];
    vmask live = group->live[k], before = v_cmp_lt_in(live, t, distance);
    vmask going = v_cmp_nlt_in(before, h, min_step(t, v_splat((float)model->march.hit_distance)));
    ray->least_sq = v_zero_where(v_andnot(going, before), ray->least_sq);
    group->t[k] = t = v_add_where(going, t, h);
    return v_cmp_ngt_in(going, outside_of_bounds(ray->exit, t), v_splat(0.0f));
}
