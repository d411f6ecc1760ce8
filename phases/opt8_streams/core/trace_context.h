// Rays that are traced together, and what a worker traces them with.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

struct march_scratch; // cones/march_scratch.h
struct packet_group;  // core/packet_group.h
struct ray_queues;    // core/ray_queues.h

struct trace_context {
    const struct prepared *scene;
    const struct view *view;
    struct packet_group *group;    // of the rays being marched now
    struct march_scratch *scratch; // the worker's memory: cones/march_scratch.h
    struct point eye;
    bool single_bulb; // bulb/bulb_single.c marches the camera rays
    struct ray_queues *queues;
};

// Rays of one group. Only lanes of `active` are marched, shaded and written. The other lanes may hold anything.
struct ray_group {
    struct point origin[GROUP];
    struct vec direction[GROUP];
    vmask active[GROUP];
    vfloat weight[GROUP]; // of their colour in their pixel
    vfloat pixel[GROUP], bounce[GROUP];
    vfloat start;             // distance at which all rays begin
    struct shape_list others; // shapes for rays that have passed all Mandelbulbs
    int marched; // first pixel of the rays in queues->marched, if they were marched; else −1
};

// Returns t where the rays of packet k begin. *cap: how many evaluations they may have, the scene's so far.
static inline vfloat start_of(const struct ray_group *rays, int k, struct trace_context *world,
                              int *cap) {
    (void)k;
    (void)world;
    (void)cap;
    return rays->start;
}
