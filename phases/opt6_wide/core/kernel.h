// One frame's work for all workers. No lanes in here.
#pragma once

#include "core/prepared.h"
#include "workers/lane_kernel.h"

struct job {
    const struct prepared *prepared;
    const struct view *view;
    struct frame *frame;
};

// core/tile.c, of each lane width: a worker's memory, a frame's tiles, and one of them.
size_t scratch_size(const struct model *model);
int count_tiles(const struct job *job);
void draw_tile(const void *data, int tile, void *scratch);
