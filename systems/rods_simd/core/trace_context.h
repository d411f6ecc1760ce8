// Rays that are traced together, and what a worker traces them with.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

// Rays of one group. Only lanes of `active` are marched, shaded and written. The other lanes may hold anything.
struct ray_group {
    struct point origin[GROUP];
    struct vec direction[GROUP];
    vmask active[GROUP];
};

struct trace_context {
    const struct prepared *scene;
    const struct view *view;
    struct packet_group *group; // of the rays being marched now
    // Where each of the group's camera rays begins, and how many evaluations it may have. start_of() takes both out,
    // so that mirror rays begin at 0 with the scene's cap.
    vfloat start[GROUP];
    int cap[GROUP]; // 0: the scene's
};

// Returns t where the rays of packet k begin. *cap: how many evaluations they may have, the scene's so far.
static inline vfloat start_of(const struct ray_group *rays, int k, struct trace_context *world,
                              int *cap) {
    (void)rays;
    vfloat start = world->start[k];
    *cap = world->cap[k] > 0 ? world->cap[k] : *cap;
    world->start[k] = v_splat(0.0f);
    world->cap[k] = 0;
    return start;
}
