// A block of pixels, and its lanes into the picture: in floats, or as displayed.
#ifndef OPT9_BLOCK_H
#define OPT9_BLOCK_H

#include "core/tile_context.h"

struct pixel_block {
    int column, row;  // of lane 0; lane i is i % 4 to the right and i / 4 below
    int across, down; // what of it is in the picture
};

static void store_plane(float *plane, int stride, const struct frame *frame,
                        struct pixel_block block, vfloat values) {
    float lanes[LANES];
    v_store(values, lanes);
    for (int row = 0; row < block.down; row++) {
        size_t first = (size_t)(block.row + row) * (size_t)frame->width + (size_t)block.column;
        for (int i = 0; i < block.across; i++)
            plane[(first + (size_t)i) * (size_t)stride] = lanes[row * BLOCK_WIDTH + i];
    }
}

static inline void display_samples(const struct frame *frame, int row, int column,
                                   const float *linear, int pixels) {
    size_t first = (size_t)row * (size_t)frame->width + (size_t)column;
    frame->show(frame->presenter, linear, 3 * (size_t)pixels, frame->shown + 3 * first);
}

static inline void display_block(const struct frame *frame, struct pixel_block block,
                                 struct vec color) {
    float lanes[3][LANES], line[3 * BLOCK_WIDTH];
    v_store(color.x, lanes[0]);
    v_store(color.y, lanes[1]);
    v_store(color.z, lanes[2]);
    for (int row = 0; row < block.down; row++) {
        for (int i = 0; i < 3 * block.across; i++)
            line[i] = lanes[i % 3][row * BLOCK_WIDTH + i / 3];
        display_samples(frame, block.row + row, block.column, line, block.across);
    }
}

#endif
