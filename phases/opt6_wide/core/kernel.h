// One frame's work, and the kernels that do it: built for 8 and for 16 lanes. No lanes in here.
#pragma once

#include "core/prepared.h"
#include "phase.h"

// One frame's work for all workers.
struct job {
    const struct prepared *prepared;
    const struct view *view;
    struct frame *frame;
};

#define KERNEL(width)                                                                              \
    size_t width##_scratch_size(const struct model *model);                                        \
    int width##_tiles(const struct frame *frame);                                                  \
    void width##_tile(const struct job *job, int tile, void *scratch);                             \
    bool width##_distances(const struct prepared *prepared, size_t count, const double *points,    \
                           double *distance, int *nearest);
KERNEL(lanes8)
KERNEL(lanes16)
#undef KERNEL
