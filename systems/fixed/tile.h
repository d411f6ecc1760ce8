// A tile of the picture, the unit of work that the threads share: a few blocks in a row.
#pragma once

#include "frame/frame.h"
#include "scene_tables.h"

enum { TILE_BLOCKS = 4 };

struct job {
    const struct scene_tables *scene;
    struct frame *frame;
};

// Render tile number `tile`, counted row by row from the top left, in one build each of tile.c (phase.json).
// `candidates`: scratch memory of the worker, room for the index of every sphere.
void lanes1_render_tile(const struct job *job, int tile, int *candidates);
void lanes8_render_tile(const struct job *job, int tile, int *candidates);
void lanes16_render_tile(const struct job *job, int tile, int *candidates);
