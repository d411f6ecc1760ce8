// What the packets of a frame share: constants in float, beside the doubles of spans/. Nothing here waits in memory
// between a ray's direction and its pixel.
#pragma once

#include "simd/simd.h"
#include "spans/spans.h"
#include "types/numerics.h"

#define NOINLINE __attribute__((__noinline__)) static

// Packets of this many rows are drawn together: while one waits for a result, the other computes.
enum { ROWS = 2 };
#define EACH_ROW(k) _Pragma("GCC unroll 2") for (int k = 0; k < ROWS; k++)

#define SHAPE(i) (&scene_known.primitives[i])

struct fused {
    struct fused_frame frame;
    float per, eye[3], forward[3], right[3], up[3], light[3], emission[3];
    float height[SHAPES];       // plane: of the camera above it
    float light_height[SHAPES]; // plane: of the light above it
    bool low[SHAPES];           // plane: the light is so low that the plane itself can darken
    bool crevice[SHAPES];       // a mirror ray may start inside of the solid
    bool any_low, stream;
};

// A row of the picture: the part of its directions that all columns share, and where its pixels are stored.
struct row {
    struct vec d;
    float up;
    int y, first;
    float *rgb; // of column `first`
};

INLINE bool any_of(const vmask m[ROWS]) {
    vmask any = m[0];
    for (int k = 1; k < ROWS; k++)
        any = v_or(any, m[k]);
    return v_any(any);
}

INLINE uint64_t bit_of(int i) {
    return 1ull << i;
}

INLINE vfloat columns_from(const struct fused *f, int x) {
    return v_madd(v_iota(), v_splat(2.0f), v_splat((float)(2 * x + 1 - f->frame.width))) *
           v_splat(f->per);
}

// Returns the directions of the pixels from column x on, not of unit length.
INLINE struct vec look(const struct fused *f, const struct row *r, int x) {
    return vec_along(r->d, vec_set(f->right), columns_from(f, x));
}

// Returns the parent's unit directions, to the bit: those that graze an edge hit it or not as there. Root and quotient are
// rounded to nearest by P. Markstein, IBM J. Res. Dev. 34(1), 1990 (all but 4 of the floats from 1 to 4).
INLINE struct vec look_at_edges(const struct fused *f, const struct row *r, int x) {
    struct vec column = vec_along(vec_set(f->forward), vec_set(f->right), columns_from(f, x));
    struct vec d = vec_along(column, vec_set(f->up), v_splat(r->up));
    vfloat square = vec_dot(d, d), per = v_rsqrt_newton(square), norm = square * per;
    norm = v_madd(v_nmadd(norm, norm, square), per * v_splat(0.5f), norm);
    return vec_scale(d, v_madd(v_nmadd(norm, per, v_splat(1.0f)), per, per));
}

// Stores a packet. Nothing is asked here: a call that is seldom made would keep registers from living on.
INLINE void put(const struct fused *f, const struct row *r, int x, struct vec color) {
    v_store_row(r->rgb + 3 * (x - r->first), f->stream, color.x, color.y, color.z);
}
