// Which program a packet of rays runs for a group: only what its rays need for a while, as long as that holds.
#pragma once

#include "core/packet_group.h"
#include "core/shape_distances.h"
#include "groups/program.h"
#include "groups/region.h"

// Whether the region holds for live rays at t.
static inline bool region_holds(const struct region *r, vfloat t, vmask live) {
    return r->serial == r->owner->owned && !v_any(v_andnot(v_cmp_le(t, r->until), live));
}

// Writes the part of the group's program that packets need from t on, into the first packet's region, and sets the
// regions of all. Each array has an element for each packet.
void prune_program(const struct local_ray *const *rays, const vfloat *t, const vmask *live,
                   int count, const struct primitive *primitive);

// Whether a part of the program is worth its search.
static inline bool is_prunable(const struct primitive *primitive) {
    return primitive->program->shapes > 2 && !primitive->repeated;
}

// Returns the program for the live rays of a packet at distance t, and for points within program->beside of them.
static inline const struct program *program_of_ray(const struct local_ray *a, vfloat t, vmask live,
                                                   const struct primitive *primitive) {
    if (!is_prunable(primitive))
        return primitive->program;
    if (!region_holds(a->region, t, live))
        prune_program(&a, &t, &live, 1, primitive);
    return a->region->owner->program;
}

static inline const struct program *program_of_packets(const struct packet_group *group, int shape,
                                                       const struct primitive *primitive) {
    if (!is_prunable(primitive))
        return primitive->program;
    const struct local_ray *rays[GROUP];
    vfloat t[GROUP];
    vmask live[GROUP];
    bool holds = true;
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        rays[i] = &group->packet[k].local[shape];
        t[i] = group->t[k];
        live[i] = group->live[k];
        holds = holds && rays[i]->region->owner == rays[0]->region->owner &&
                region_holds(rays[i]->region, t[i], live[i]);
    }
    if (!holds)
        prune_program(rays, t, live, group->count, primitive);
    return rays[0]->region->owner->program;
}

// Returns the size of the regions of `packets` packets, for all groups of the model.
size_t regions_size(const struct model *model, int packets);

// Gives each packet's rays their regions in `memory`. local[k]: the rays of packet k, one for each shape.
void place_regions(void *memory, const struct model *model, struct local_ray *const *local,
                   int packets);
