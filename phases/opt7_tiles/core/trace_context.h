// Rays that are traced together, and what a worker traces them with.
#ifndef TRACE_CONTEXT_H
#define TRACE_CONTEXT_H

#include "core/primitive.h"
#include "simd/simd.h"

// Of the packets of the group that is under way. Only lanes of `active` are marched, shaded and written; the others may
// hold anything.
struct ray_group {
    struct point *origin;
    struct vec *direction;
    vmask *active;
    vfloat start; // where they begin
};

struct trace_context {
    const struct prepared *scene;
    const struct view *view;
    struct packet_group *group;    // of the rays being marched now
    struct march_scratch *scratch; // the worker's (cones/march_scratch.h)
};

#endif
