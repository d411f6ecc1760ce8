// Stores the pixels of a tile: linear colours, other channels, or 8-bit colours as displayed.
#include "frame/tile.h"
#include "phase.h"
#include "simd/simd.h"

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

KERNEL_SHARED void store_hit(struct frame *frame, struct pixel_block block,
                             const struct surface_hit *hit, struct vec normal) {
    struct vec n = {v_select_or_zero(hit->found, normal.x), v_select_or_zero(hit->found, normal.y),
                    v_select_or_zero(hit->found, normal.z)};
    store_aov(frame, block, hit->found, hit->t, v_select(hit->found, hit->shape, v_splat(-1.0f)), n,
              v_splat(1.0f));
}

KERNEL_SHARED void store_block(struct frame *frame, struct pixel_block block, struct vec color) {
    if (frame->shown) {
        display_block(frame, block, color);
        return;
    }
    store_color(frame, block, color);
}

KERNEL_SHARED void store_colors(struct frame *frame, struct pixel_block block, const float *color) {
    store_block(
        frame, block,
        (struct vec){v_load(color), v_load(color + COLOR_ROOM), v_load(color + 2 * COLOR_ROOM)});
}

// Returns whether rows of the picture are whole cache lines. If so, stores bypass the caches. Other threads
// see them in time: workers_run() ends with a lock, and x86 instructions with LOCK wait for write-combining
// buffers (Intel SDM vol. 3, "Buffering of Write Combining Memory Locations"; AMD APM vol. 2).
static bool past_caches(const struct frame *frame) {
    return frame->width % 16 == 0 && (uintptr_t)frame->rgb % 64 == 0;
}

// Returns whether the tile is made of whole blocks, so that store_rows() can store whole rows of it.
KERNEL_SHARED bool is_whole_lines(int left, int right, int top, int bottom) {
    return (right - left) % 16 == 0 && (bottom - top) % BLOCK_HEIGHT == 0;
}

// Returns where a tile's pixel row begins among the lanes of its blocks.
static inline const float *row_from(const float *color, int row, int across) {
    return color + row / BLOCK_HEIGHT * across * BLOCK_HEIGHT + row % BLOCK_HEIGHT * BLOCK_WIDTH;
}

static inline void display_rows(struct frame *frame, int left, int right, int top, int bottom,
                                const float *color) {
    float line[3 * TILE_WIDTH];
    int across = right - left;
    for (int row = top; row < bottom; row++) {
        const float *from = row_from(color, row - top, across);
        for (int i = 0; i < across; i += LANES, from += LANES * BLOCK_HEIGHT)
            v_store_row(line + 3 * i, false, v_load_block_row(from),
                        v_load_block_row(from + COLOR_ROOM),
                        v_load_block_row(from + 2 * COLOR_ROOM));
        display_samples(frame, row, left, line, across);
    }
}

KERNEL_SHARED void store_rows(struct frame *frame, int left, int right, int top, int bottom,
                              const float *color) {
    if (frame->shown) {
        display_rows(frame, left, right, top, bottom, color);
        return;
    }
    const bool past = past_caches(frame);
    int across = right - left;
    for (int row = top; row < bottom; row++) {
        size_t first = (size_t)row * (size_t)frame->width + (size_t)left;
        const float *from = row_from(color, row - top, across);
        for (int i = 0; i < across; i += LANES, from += LANES * BLOCK_HEIGHT)
            v_store_row(frame->rgb + 3 * (first + (size_t)i), past, v_load_block_row(from),
                        v_load_block_row(from + COLOR_ROOM),
                        v_load_block_row(from + 2 * COLOR_ROOM));
    }
}

static void display_background(struct frame *frame, int left, int right, int top, int bottom,
                               const struct known_model *model) {
    float line[3 * TILE_WIDTH];
    for (int i = 0; i < 3 * TILE_WIDTH; i++)
        line[i] = (float)model->background[i % 3];
    display_samples(frame, top, left, line, right - left);
    size_t pitch = 3 * (size_t)frame->width;
    const uint8_t *first = frame->shown + (size_t)top * pitch + 3 * (size_t)left;
    for (int row = top + 1; row < bottom; row++)
        memcpy(frame->shown + (size_t)row * pitch + 3 * (size_t)left, first,
               3 * (size_t)(right - left));
}

KERNEL_SHARED void fill_background(struct frame *frame, int left, int right, int top, int bottom,
                                   const struct known_model *model) {
    if (frame->shown) {
        display_background(frame, left, right, top, bottom, model);
        return;
    }
    enum { REGISTERS = 3 }; // registers that hold a whole number of pixels
    const bool past = past_caches(frame);
    vfloat part[REGISTERS];
    float color[REGISTERS * LANES];
    for (int i = 0; i < REGISTERS * LANES; i++)
        color[i] = (float)model->background[i % 3];
    for (int i = 0; i < REGISTERS; i++)
        part[i] = v_load(color + i * LANES);
    for (int row = top; row < bottom; row++) {
        size_t first = (size_t)row * (size_t)frame->width + (size_t)left,
               count = (size_t)(right - left);
        float *to = frame->rgb + 3 * first;
        size_t more = 3 * count;
        for (; more >= REGISTERS * LANES; more -= REGISTERS * LANES)
            for (int i = 0; i < REGISTERS; i++, to += LANES)
                v_store_or_stream(to, past, part[i]);
        memcpy(to, color, more * sizeof *to);
        for (size_t i = first; frame->depth && i < first + count; i++) {
            frame->depth[i] = INFINITY;
            frame->id[i] = -1;
            frame->normal[3 * i] = frame->normal[3 * i + 1] = frame->normal[3 * i + 2] = 0;
            frame->evals[i] = 1;
        }
    }
}
