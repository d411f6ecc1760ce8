// The camera's rays through the pixels of a block.
#pragma once

#include "simd/simd.h"

#include "core/pixel_block.h" // needs simd.h

// For each lane of a block: twice its column, and its row.
static const float twice_right[16] = {0, 2, 4, 6, 0, 2, 4, 6, 0, 2, 4, 6, 0, 2, 4, 6};
static const float row_below[16] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};

// Returns the lanes of a block that are in the picture.
static inline vmask in_picture(struct pixel_block block) {
    return v_and(v_cmp_lt(v_load(twice_right), v_splat(2.0f * (float)block.across)),
                 v_cmp_lt(v_load(row_below), v_splat((float)block.down)));
}

// Returns the directions of a block's camera rays, of unit length.
static inline struct vec get_direction(struct pixel_block block, const struct frame *frame,
                                       const struct view *view) {
    double per_height = view->tan_half_fov / frame->height, top = frame->height - 1.0;
    // Rows are selected by masks: loading floats that were just stored one by one would stall.
    vfloat y = v_splat(0.0f);
    for (int i = 0; i < BLOCK_HEIGHT; i++) {
        vfloat row = v_splat((float)((top - 2.0 * (block.row + i)) * per_height));
        y = i == 0 ? row : v_select(v_cmp_lt(v_load(row_below), v_splat((float)i)), y, row);
    }
    vfloat columns =
        v_load(twice_right) + v_splat((float)(2 * block.column + 1 - frame->width)); // exact
    vfloat x = columns * v_splat((float)per_height);
    struct vec d = vec_along(vec_from_doubles(view->forward), vec_from_doubles(view->right), x);
    d = vec_along(d, vec_from_doubles(view->up), y);
    return vec_scale(d, v_splat(1.0f) / vec_norm(d));
}
