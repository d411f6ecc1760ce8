// Rays that are traced together, and what a worker traces them with.
#pragma once

#include "core/primitive.h"
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
};
