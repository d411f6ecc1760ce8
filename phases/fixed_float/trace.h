// What render.c calls of tile.c, in each of its widths.
#ifndef FIXED_TRACE_H
#define FIXED_TRACE_H

#include <stddef.h>

#include "world.h"

struct job {
    const struct world *world;
    struct frame *frame;
};

// A tile is a few blocks in a row; `own` has room for the numbers of all spheres.
void lanes8_tile(const struct job *job, int tile, void *own);
void lanes16_tile(const struct job *job, int tile, void *own);
#define TILES(lanes, job, tile, own) ((lanes) == 16 ? lanes16_tile : lanes8_tile)(job, tile, own)

enum { TILE_BLOCKS = 4 };

#endif
