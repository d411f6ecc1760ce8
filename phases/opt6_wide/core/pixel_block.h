// Blocks of 4 × LANES/4 pixels: the pixels of a packet. Lanes outside of the picture are masked. simd/simd.h comes before
// it.
#pragma once

#include "core/prepared.h"
#include "phase.h"

enum { BLOCK_WIDTH = 4, BLOCK_HEIGHT = LANES / BLOCK_WIDTH };

static inline struct point point_from_doubles(const double a[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(a[i], &hi[i], &lo[i]);
    return (struct point){vec_set(hi), vec_set(lo)};
}

struct pixel_block {
    int column, row;  // of lane 0; lane i is i % 4 to the right and i / 4 below
    int across, down; // columns and rows that are in the picture
};

// Stores one value per pixel, `stride` floats apart.
static inline void store_plane(float *plane, int stride, const struct frame *frame,
                               struct pixel_block block, vfloat values) {
    float lanes[LANES];
    v_store(values, lanes);
    for (int row = 0; row < block.down; row++) {
        size_t first = (size_t)(block.row + row) * (size_t)frame->width + (size_t)block.column;
        for (int i = 0; i < block.across; i++)
            plane[(first + (size_t)i) * (size_t)stride] = lanes[row * BLOCK_WIDTH + i];
    }
}

static inline void store_color(struct frame *frame, struct pixel_block block, struct vec color) {
    size_t width = (size_t)frame->width;
    float *rgb = frame->rgb + 3 * ((size_t)block.row * width + (size_t)block.column);
    if (block.across == BLOCK_WIDTH && block.down == BLOCK_HEIGHT) {
        v_store_block(rgb, 3 * width, color.x, color.y, color.z);
        return;
    }
    store_plane(frame->rgb, 3, frame, block, color.x);
    store_plane(frame->rgb + 1, 3, frame, block, color.y);
    store_plane(frame->rgb + 2, 3, frame, block, color.z);
}

// Stores the other channels of a block.
static inline void store_aov(struct frame *frame, struct pixel_block block, vmask found, vfloat t,
                             vfloat shape, struct vec normal, vfloat evals) {
    store_plane(frame->depth, 1, frame, block, v_select(found, t, v_splat(INFINITY)));
    store_plane(frame->id, 1, frame, block, shape);
    store_plane(frame->normal, 3, frame, block, normal.x);
    store_plane(frame->normal + 1, 3, frame, block, normal.y);
    store_plane(frame->normal + 2, 3, frame, block, normal.z);
    store_plane(frame->evals, 1, frame, block, evals);
}

static inline int int_min(int a, int b) {
    return a < b ? a : b;
}
