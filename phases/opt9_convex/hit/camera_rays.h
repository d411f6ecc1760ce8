// The blocks of a tile and the directions of their camera rays: in floats, and in doubles for a Mandelbulb.
#ifndef OPT9_CAMERA_H
#define OPT9_CAMERA_H

#include "bulb/bulb_estimate.h"
#include "core/store_pixels.h"
#include "simd/point.h"

static inline vmask in_picture(struct pixel_block block) {
    COUNT(in_picture, call);
    if (block.across == BLOCK_WIDTH && block.down == BLOCK_HEIGHT)
        return v_mask_all();
    COUNT(in_picture, cut);
    vfloat below = v_floor(v_iota() * v_splat(1.0f / BLOCK_WIDTH));
    return v_and(v_cmp_lt(v_iota() - below * v_splat(BLOCK_WIDTH), v_splat((float)block.across)),
                 v_cmp_lt(below, v_splat((float)block.down)));
}

// What the tile's blocks have in common.
struct tile {
    int left, right, top, bottom;
    struct vec eye, ahead, across, up;
    vfloat below, beside; // of the lanes in their block, in pixels
    float per_height;
};

static inline struct pixel_block block_at(const struct tile *tile, int row, int i) {
    int column = tile->left + i * BLOCK_WIDTH;
    return (struct pixel_block){column, row, int_min(BLOCK_WIDTH, tile->right - column),
                                int_min(BLOCK_HEIGHT, tile->bottom - row)};
}

// A direction, not of unit length, but for its part up, which is the row's: of blocks one below the other it is the same.
static inline struct vec column_of(const struct tile *tile, int column, const struct frame *frame) {
    COUNT(column_of, call);
    vfloat x =
        v_madd(v_splat(2.0f), tile->beside, v_splat((float)(2 * column + 1 - frame->width))) *
        v_splat(tile->per_height);
    return vec_along(tile->ahead, tile->across, x);
}

static inline vfloat row_of_picture(const struct tile *tile, int row, const struct frame *frame) {
    COUNT(row_of_picture, call);
    return v_nmadd(v_splat(2.0f), tile->below, v_splat((float)(frame->height - 1 - 2 * row))) *
           v_splat(tile->per_height);
}

static inline struct vec direction_in(const struct tile *tile, struct vec column, vfloat row) {
    COUNT(direction_in, call);
    struct vec d = vec_along(column, tile->up, row);
    return vec_scale(d, v_splat(1.0f) / vec_norm(d));
}

static inline struct vec get_direction(const struct tile *tile, struct pixel_block block,
                                       const struct frame *frame) {
    COUNT(get_direction, call);
    return direction_in(tile, column_of(tile, block.column, frame),
                        row_of_picture(tile, block.row, frame));
}

// The camera in a Mandelbulb's frame, in doubles: as floats, its rays would pass by what they are to meet.
struct camera_double {
    double at[3], ahead[3], across[3], up[3];
};

static struct camera_double exact_eye_of(const struct primitive *s, const struct view *view) {
    COUNT(exact_eye_of, call);
    struct camera_double eye = {{0}, {0}, {0}, {0}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            eye.at[i] += s->row[i][k] * (view->position[k] - s->centre[k]);
            eye.ahead[i] += s->row[i][k] * view->forward[k];
            eye.across[i] += s->row[i][k] * view->right[k];
            eye.up[i] += s->row[i][k] * view->up[k];
        }
    return eye;
}

static inline vdouble v_double_add(vdouble a, double b) {
    vhalf each = v_half_splat(b);
    return (vdouble){a.low + each, a.high + each};
}

static struct vec_double exact_look(const struct tile *tile, struct pixel_block block,
                                    const struct camera_double *eye, const struct job *job) {
    COUNT(exact_look, call);
    COUNT(exact_look, scalar);
    double per_height = job->view->tan_half_fov / job->frame->height;
    vfloat zero = v_splat(0.0f), two = v_splat(2.0f);
    vfloat x =
        v_madd(two, tile->beside, v_splat((float)(2 * block.column + 1 - job->frame->width)));
    vfloat y = v_nmadd(two, tile->below, v_splat((float)(job->frame->height - 1 - 2 * block.row)));
    vdouble right = v_double_mul(v_double_sum(x, zero), per_height);
    vdouble above = v_double_mul(v_double_sum(y, zero), per_height);
    vdouble d[3];
    vhalf low = v_half_splat(0.0), high = low;
    for (int i = 0; i < 3; i++) {
        d[i] = v_double_add(v_double_madd(right, eye->across[i], v_double_mul(above, eye->up[i])),
                            eye->ahead[i]);
        low = v_half_madd(d[i].low, d[i].low, low);
        high = v_half_madd(d[i].high, d[i].high, high);
    }
    low = v_half_splat(1.0) / v_half_sqrt(low);
    high = v_half_splat(1.0) / v_half_sqrt(high);
    for (int i = 0; i < 3; i++)
        d[i] = (vdouble){d[i].low * low, d[i].high * high};
    return (struct vec_double){d[0], d[1], d[2]};
}

static inline vdouble v_double_splat(double a) {
    return (vdouble){v_half_splat(a), v_half_splat(a)};
}

#endif
