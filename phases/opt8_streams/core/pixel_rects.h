// Where tiles, squares, patches and blocks are in the picture. A strip is STRIP_TILES tiles side by side. A square is two
// by two patches. A patch is BLOCKS blocks, each the pixels of one packet.
#pragma once

#include "cones/pixel_cones.h"
#include "core/pixel_block.h"
#include "core/ray_queues.h"

enum {
    BLOCKS = PATCH / BLOCK_WIDTH * (PATCH / BLOCK_HEIGHT), // in a patch
    SQUARE = 2 * PATCH,                                    // pixels on each side
    SQUARES_ACROSS = STRIP_TILES * PATCHES_ACROSS / 2
};

static inline int tiles_across(const struct frame *frame) {
    return (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
}

// Returns the patch of a tile that lane `lane` of its cones covers.
static inline struct pixel_rect rect_of_patch(int tile, int lane, const struct frame *frame) {
    int left = tile % tiles_across(frame) * TILE_WIDTH + lane % PATCHES_ACROSS * PATCH;
    int top = tile / tiles_across(frame) * TILE_HEIGHT + lane / PATCHES_ACROSS * PATCH;
    return (struct pixel_rect){left, top, int_min(frame->width, left + PATCH),
                               int_min(frame->height, top + PATCH)};
}

// Returns the square that lane `lane` of a strip's cones covers. `tile` is the strip's first tile.
static inline struct pixel_rect rect_of_square(int tile, int lane, const struct frame *frame) {
    int left = tile % tiles_across(frame) * TILE_WIDTH + lane % SQUARES_ACROSS * SQUARE;
    int top = tile / tiles_across(frame) * TILE_HEIGHT + lane / SQUARES_ACROSS * SQUARE;
    return (struct pixel_rect){left, top, int_min(frame->width, left + SQUARE),
                               int_min(frame->height, top + SQUARE)};
}

// Returns the lane of the square that holds a patch: lane `lane` of the strip's tile number `column`.
static inline int parent_square(int column, int lane) {
    return lane / PATCHES_ACROSS / 2 * SQUARES_ACROSS + column * (PATCHES_ACROSS / 2) +
           lane % PATCHES_ACROSS / 2;
}

// Returns a patch's block number `number`, row by row.
static inline struct pixel_block block_in_rect(const struct pixel_rect *patch, int number) {
    int column = patch->left + number % (PATCH / BLOCK_WIDTH) * BLOCK_WIDTH;
    int row = patch->top + number / (PATCH / BLOCK_WIDTH) * BLOCK_HEIGHT;
    return (struct pixel_block){column, row, int_min(BLOCK_WIDTH, patch->right - column),
                                int_min(BLOCK_HEIGHT, patch->bottom - row)};
}
