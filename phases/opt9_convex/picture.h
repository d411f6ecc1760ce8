// Blocks of a tile into the picture.
#ifndef OPT9_PICTURE_H
#define OPT9_PICTURE_H

#include "stage.h"

struct block {
    int column, row;  // of lane 0; lane i is i % 4 to the right and i / 4 below
    int across, down; // what of it is in the picture
};

static void store_plane(float *plane, int stride, const struct frame *frame, struct block block,
                        real values) {
    float lanes[LANES];
    unload(values, lanes);
    for (int row = 0; row < block.down; row++) {
        size_t first = (size_t)(block.row + row) * (size_t)frame->width + (size_t)block.column;
        for (int i = 0; i < block.across; i++)
            plane[(first + (size_t)i) * (size_t)stride] = lanes[row * BLOCK_WIDTH + i];
    }
}

static void store_hit(struct frame *frame, struct block block, const struct found *hit,
                      struct vec normal) {
    store_plane(frame->depth, 1, frame, block, choose(hit->found, hit->t, set(INFINITY)));
    store_plane(frame->id, 1, frame, block, choose(hit->found, hit->shape, set(-1.0f)));
    store_plane(frame->normal, 3, frame, block, keep(hit->found, normal.x));
    store_plane(frame->normal + 1, 3, frame, block, keep(hit->found, normal.y));
    store_plane(frame->normal + 2, 3, frame, block, keep(hit->found, normal.z));
    store_plane(frame->evals, 1, frame, block, set(1.0f));
}

static inline void store_block_of(struct frame *frame, struct block block, struct vec color) {
    float *rgb = frame->rgb + 3 * ((size_t)block.row * (size_t)frame->width + (size_t)block.column);
    if (block.across == BLOCK_WIDTH && block.down == BLOCK_HEIGHT) {
        store_block(rgb, 3 * (size_t)frame->width, color.x, color.y, color.z);
        return;
    }
    store_plane(frame->rgb, 3, frame, block, color.x);
    store_plane(frame->rgb + 1, 3, frame, block, color.y);
    store_plane(frame->rgb + 2, 3, frame, block, color.z);
}

static void store_colors(struct frame *frame, struct block block, const float *color) {
    store_block_of(
        frame, block,
        (struct vec){load(color), load(color + COLOR_ROOM), load(color + 2 * COLOR_ROOM)});
}

#if LANES == 16
// Of a tile of whole blocks, sixteen pixels of a row at once: three whole cache lines where the row begins with one, in
// place of four pieces of one and two.
static bool whole_lines(int left, int right, int top, int bottom) {
    return (right - left) % 16 == 0 && (bottom - top) % BLOCK_HEIGHT == 0;
}

static void store_lines(struct frame *frame, int left, int right, int top, int bottom,
                        const float *color) {
    int across = right - left;
    for (int row = top; row < bottom; row++) {
        size_t first = (size_t)row * (size_t)frame->width + (size_t)left;
        const float *from = color + (row - top) / BLOCK_HEIGHT * across * BLOCK_HEIGHT +
                            (row - top) % BLOCK_HEIGHT * BLOCK_WIDTH;
        for (int i = 0; i < across; i += 16, from += 16 * BLOCK_HEIGHT)
            store_row(frame->rgb + 3 * (first + (size_t)i), row_of(from), row_of(from + COLOR_ROOM),
                      row_of(from + 2 * COLOR_ROOM));
    }
}
#endif

static void fill_background(struct frame *frame, int left, int right, int top, int bottom,
                            const struct model *model) {
    float color[3] = {(float)model->background[0], (float)model->background[1],
                      (float)model->background[2]};
    for (int row = top; row < bottom; row++) {
        size_t first = (size_t)row * (size_t)frame->width + (size_t)left,
               count = (size_t)(right - left);
        for (size_t i = 3 * first; i < 3 * (first + count); i += 3)
            for (int k = 0; k < 3; k++)
                frame->rgb[i + (size_t)k] = color[k];
        for (size_t i = first; frame->depth && i < first + count; i++) {
            frame->depth[i] = INFINITY;
            frame->id[i] = -1;
            frame->normal[3 * i] = frame->normal[3 * i + 1] = frame->normal[3 * i + 2] = 0;
            frame->evals[i] = 1;
        }
    }
}

#endif
