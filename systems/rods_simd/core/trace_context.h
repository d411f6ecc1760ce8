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
    // Of the group's camera rays: where each begins, and how many evaluations it may have. march_state_of() takes both
    // out, so that mirror rays begin at 0 with the scene's cap.
    vfloat start[GROUP];
    int cap[GROUP]; // 0: the scene's
};
