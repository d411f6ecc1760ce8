// Camera rays of a tile among the copies of repeated shapes.
#ifndef OPT9_LAYERS_H
#define OPT9_LAYERS_H

#include "cells.h"

enum {
    ACROSS = TILE_WIDTH / BLOCK_WIDTH,
    DOWN = TILE_HEIGHT / BLOCK_HEIGHT,
    BLOCKS = ACROSS * DOWN
};

// The planes through the camera between the tile's columns and rows of blocks, as it sees the picture's plane at
// distance 1: their places there.
struct mesh {
    float left, top, pixel; // pixel: its width
    int across, down;       // blocks in the picture
};

// What a tile's packets meet of all shapes that are repeated as the shape `first` is, if it is the first of them.
KNOWN_SHARED void meet_layers(int first, const struct mesh *mesh, const struct job *job,
                              struct sight *sights);

#endif
