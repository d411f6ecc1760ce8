// The camera's rays through the pixels of a block.
#pragma once

#include "core/pixel_block.h"

// Returns the lanes of a block that are in the picture.
static inline vmask in_picture(struct pixel_block block) {
    static const float right[16] = {0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3};
    static const float below[16] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};
    return v_and(v_cmp_lt(v_load(right), v_splat((float)block.across)),
                 v_cmp_lt(v_load(below), v_splat((float)block.down)));
}

// Returns the directions of a block's camera rays, of unit length.
static inline struct vec get_direction(struct pixel_block block, const struct frame *frame,
                                       const struct view *view) {
    double per_height = view->tan_half_fov / frame->height, top = frame->height - 1.0;
    float columns[LANES], rows[LANES];
    for (int i = 0; i < BLOCK_HEIGHT; i++) {
        float y = (float)((top - 2.0 * (block.row + i)) * per_height);
        for (int lane = i * BLOCK_WIDTH; lane < (i + 1) * BLOCK_WIDTH; lane++) {
            int column = block.column + lane % BLOCK_WIDTH;
            columns[lane] = (float)(2 * column + 1 - frame->width); // exact
            rows[lane] = y;
        }
    }
    vfloat x = v_load(columns) * v_splat((float)per_height), y = v_load(rows);
    struct vec d = vec_along(vec_from_doubles(view->forward), vec_from_doubles(view->right), x);
    d = vec_along(d, vec_from_doubles(view->up), y);
    return vec_scale(d, v_splat(1.0f) / vec_norm(d));
}
