// Rays that are traced together, and what a worker traces them with.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

// Rays of the group that marches now, one element per packet. Only lanes of `active` are marched, shaded and written.
// The other lanes may hold anything.
struct ray_group {
    struct point *origin;
    struct vec *direction;
    vmask *active;
    vfloat start; // distance at which all rays begin
};

struct trace_context {
    const struct prepared *scene;
    const struct view *view;
    struct packet_group *group;    // of the rays being marched now
    struct march_scratch *scratch; // the worker's memory: cones/march_scratch.h
};

// Returns t where the rays of packet k begin. *cap: how many evaluations they may have, the scene's so far.
static inline vfloat start_of(const struct ray_group *rays, int k, struct trace_context *world,
                              int *cap) {
    (void)k;
    (void)world;
    (void)cap;
    return rays->start;
}
