// A tile of the picture, the unit of work that the threads share: a few blocks in a row.
#pragma once

#include "frame/frame.h"
#include "scene_tables.h"
#include "workers/workers.h"

enum { TILE_BLOCKS = 4 };

struct job {
    const struct scene_tables *scene;
    struct frame *frame;
};

// Render a tile of a struct job, counted row by row from the top left, in one build each of tile.c (phase.json).
// Scratch memory: room for the index of every sphere.
workers_task lanes1_render_tile, lanes8_render_tile, lanes16_render_tile;
