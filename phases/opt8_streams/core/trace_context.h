// Rays that are traced together, and what a worker traces them with.
#ifndef TRACE_CONTEXT_H
#define TRACE_CONTEXT_H

#include "core/primitive.h"
#include "simd/simd.h"

struct march_scratch; // cones/march_scratch.h
struct packet_group;  // core/packet_group.h
struct ray_queues;    // core/ray_queues.h

struct trace_context {
    const struct prepared *scene;
    const struct view *view;
    struct packet_group *group;    // of the rays being marched now
    struct march_scratch *scratch; // the worker's (cones/tile_cones.h)
    struct point eye;
    bool single_bulb; // camera rays go by bulb/bulb_single.c
    struct ray_queues *queues;
};

// Only lanes of `active` are marched, shaded and written; the others may hold anything.
struct ray_group {
    struct point origin[GROUP];
    struct vec direction[GROUP];
    vmask active[GROUP];
    vfloat weight[GROUP]; // of what they see in their pixel
    vfloat pixel[GROUP], bounce[GROUP];
    vfloat start;             // where they begin
    struct shape_list others; // what those of them can meet that no Mandelbulb is before
    int marched;              // the pixel of the first, if the desk knows where they end; else −1
};

#endif
