// The blocks of a tile and the directions of their camera rays: in floats, and in doubles for a Mandelbulb.
#ifndef OPT9_CAMERA_H
#define OPT9_CAMERA_H

#include "bulb.h"
#include "picture.h"

static inline mask in_picture(struct block block) {
    COUNT(in_picture, call);
    if (block.across == BLOCK_WIDTH && block.down == BLOCK_HEIGHT)
        return all_lanes();
    COUNT(in_picture, cut);
    real below = floor_of(lane_numbers() * set(1.0f / BLOCK_WIDTH));
    return both(less(lane_numbers() - below * set(BLOCK_WIDTH), set((float)block.across)),
                less(below, set((float)block.down)));
}

// What the tile's blocks have in common.
struct tile {
    int left, right, top, bottom;
    struct vec eye, ahead, across, up;
    real below, beside; // of the lanes in their block, in pixels
    float per_height;
};

static inline struct block block_at(const struct tile *tile, int row, int i) {
    int column = tile->left + i * BLOCK_WIDTH;
    return (struct block){column, row, lesser(BLOCK_WIDTH, tile->right - column),
                          lesser(BLOCK_HEIGHT, tile->bottom - row)};
}

// A direction, not of unit length, but for its part up, which is the row's: of blocks one below the other it is the same.
static inline struct vec column_of(const struct tile *tile, int column, const struct frame *frame) {
    COUNT(column_of, call);
    real x = mul_add(set(2.0f), tile->beside, set((float)(2 * column + 1 - frame->width))) *
             set(tile->per_height);
    return vec_along(tile->ahead, tile->across, x);
}

static inline real row_of_picture(const struct tile *tile, int row, const struct frame *frame) {
    COUNT(row_of_picture, call);
    return neg_mul_add(set(2.0f), tile->below, set((float)(frame->height - 1 - 2 * row))) *
           set(tile->per_height);
}

static inline struct vec direction_in(const struct tile *tile, struct vec column, real row) {
    COUNT(direction_in, call);
    struct vec d = vec_along(column, tile->up, row);
    return vec_scale(d, set(1.0f) / vec_norm(d));
}

static inline struct vec get_direction(const struct tile *tile, struct block block,
                                       const struct frame *frame) {
    COUNT(get_direction, call);
    return direction_in(tile, column_of(tile, block.column, frame),
                        row_of_picture(tile, block.row, frame));
}

// The camera in a Mandelbulb's frame, in doubles: as floats, its rays would pass by what they are to meet.
struct exact_eye {
    double at[3], ahead[3], across[3], up[3];
};

static struct exact_eye exact_eye_of(const struct placed *s, const struct view *view) {
    COUNT(exact_eye_of, call);
    struct exact_eye eye = {{0}, {0}, {0}, {0}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            eye.at[i] += s->row[i][k] * (view->position[k] - s->centre[k]);
            eye.ahead[i] += s->row[i][k] * view->forward[k];
            eye.across[i] += s->row[i][k] * view->right[k];
            eye.up[i] += s->row[i][k] * view->up[k];
        }
    return eye;
}

static inline wide wide_add(wide a, double b) {
    half each = half_set(b);
    return (wide){a.low + each, a.high + each};
}

static struct wide_vec exact_look(const struct tile *tile, struct block block,
                                  const struct exact_eye *eye, const struct job *job) {
    COUNT(exact_look, call);
    COUNT(exact_look, scalar);
    double per_height = job->view->tan_half_fov / job->frame->height;
    real zero = set(0.0f), two = set(2.0f);
    real x = mul_add(two, tile->beside, set((float)(2 * block.column + 1 - job->frame->width)));
    real y = neg_mul_add(two, tile->below, set((float)(job->frame->height - 1 - 2 * block.row)));
    wide right = wide_mul(wide_sum(x, zero), per_height);
    wide above = wide_mul(wide_sum(y, zero), per_height);
    wide d[3];
    half low = half_set(0.0), high = low;
    for (int i = 0; i < 3; i++) {
        d[i] = wide_add(wide_mul_add(right, eye->across[i], wide_mul(above, eye->up[i])),
                        eye->ahead[i]);
        low = half_mul_add(d[i].low, d[i].low, low);
        high = half_mul_add(d[i].high, d[i].high, high);
    }
    low = half_set(1.0) / half_root(low);
    high = half_set(1.0) / half_root(high);
    for (int i = 0; i < 3; i++)
        d[i] = (wide){d[i].low * low, d[i].high * high};
    return (struct wide_vec){d[0], d[1], d[2]};
}

static inline wide wide_set(double a) {
    return (wide){half_set(a), half_set(a)};
}

#endif
