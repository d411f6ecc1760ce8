// Camera rays of a tile among the copies of repeated shapes.
#ifndef OPT9_LAYERS_H
#define OPT9_LAYERS_H

#include "repetition/repeated_rays.h"

enum {
    BLOCKS_ACROSS = TILE_WIDTH / BLOCK_WIDTH,
    BLOCKS_DOWN = TILE_HEIGHT / BLOCK_HEIGHT,
    BLOCKS = BLOCKS_ACROSS * BLOCKS_DOWN
};

// The planes through the camera between the tile's columns and rows of blocks, as it sees the picture's plane at
// distance 1: their places there.
struct block_grid {
    float left, top, pixel; // pixel: its width
    int across, down;       // blocks in the picture
};

// What a tile's packets meet of all shapes that are repeated as the shape `first` is, if it is the first of them.
KERNEL_INLINE void hit_repeated(int first, const struct block_grid *mesh, const struct job *job,
                                struct primary_hit *sights);

#endif
