// A ray's way from cell to cell of a repeated shape: see repetition/repeated_rays.c. And the same for a tile's bundles of
// camera rays (repetition/repeated_bundles.c).
#ifndef OPT9_CELL_WALK_H
#define OPT9_CELL_WALK_H

#include "core/sdf.h"
#include "core/shading_packet.h"
#include "core/tile_context.h"
#include "hit/solids.h"
#include "repetition/repeated_rays.h"

// One axis: the ray is at the middle of its cell at `middle` = base + count·step, and there within `half` of the
// box about the copy, within `wall` of the cell. All in units of t, of which `size` are as long as 1 along it.
struct cell_axis {
    vfloat base, step, half, wall, count, middle, size;
};

static inline struct cell_axis cell_axis_of(vfloat o, vfloat d, float cell, float half) {
    COUNT(cell_axis_of, call);
    COUNT(cell_axis_of, scalar);
    vfloat zero = v_splat(0.0f), per = inverse_of(d), size = v_abs(per), base = zero - o * per;
    vfloat wall = v_splat(0.5f * cell) * size;
    if (!(cell > 0.0f))
        wall = v_splat(INFINITY);
    return (struct cell_axis){base, v_splat(cell) * size, v_splat(half) * size, wall, zero, base,
                              size};
}

static inline vfloat cell_exit(const struct cell_axis *x, const struct cell_axis *y,
                               const struct cell_axis *z) {
    return v_min(x->middle + x->wall, v_min(y->middle + y->wall, z->middle + z->wall));
}

static inline void next_on_axis(struct cell_axis *a, vmask going, vfloat leaves) {
    vmask through = v_and(going, v_cmp_ge(leaves, a->middle + a->wall));
    a->count = a->count + v_select_or_zero(through, v_splat(1.0f));
    a->middle = v_madd(a->count, a->step, a->base);
}

struct cell_walk {
    struct cell_axis x, y, z;
    vfloat end;
};

// Into the next cells; those that are not at their end there.
static inline vmask next_cells(struct cell_walk *w, vmask going) {
    ACTIVE(v_count(going));
    COUNT(next_cells, call);
    vfloat leaves = cell_exit(&w->x, &w->y, &w->z);
    going = v_and(going, v_cmp_lt(leaves, w->end));
    next_on_axis(&w->x, going, leaves);
    next_on_axis(&w->y, going, leaves);
    next_on_axis(&w->z, going, leaves);
    return going;
}

static inline vfloat box_entry(const struct cell_walk *w) {
    return v_max(w->x.middle - w->x.half, v_max(w->y.middle - w->y.half, w->z.middle - w->z.half));
}

// Where the rays meet the next box; of `skip` not the first.
static inline vmask next_box(struct cell_walk *w, vmask going, vmask skip) {
    COUNT(next_box, call);
    vmask met = v_mask_none();
    while (v_any(going)) {
        ACTIVE(v_count(going));
        COUNT(next_box, cell);
        vfloat in = box_entry(w);
        vfloat out =
            v_min(w->x.middle + w->x.half, v_min(w->y.middle + w->y.half, w->z.middle + w->z.half));
        vmask here = v_and(v_and(going, v_cmp_ge(out, in)),
                           v_and(v_cmp_gt(out, v_splat(0.0f)), v_cmp_lt(in, w->end)));
        here = v_andnot(skip, here);
        skip = v_mask_none();
        met = v_or(met, here);
        going = next_cells(w, v_andnot(here, going));
    }
    return met;
}

enum {
    BUNDLE_HEIGHT = 4, // and as wide as a block
    BUNDLE_BLOCKS = BUNDLE_HEIGHT / BLOCK_HEIGHT,
    BUNDLES = BLOCKS_ACROSS * TILE_HEIGHT / BUNDLE_HEIGHT
};

_Static_assert(BUNDLES % LANES == 0, "whole registers");

struct cell_grid {
    const struct prepared *scene;
    double eye[3], size[3];
    float spread, bounds, slack; // slack: what float may have lost of a place
    bool only_grid, first;       // no shape is repeated in another way; nothing was met before
    struct primary_hit *hits;
    vmask left[BLOCKS]; // rays that have not met a copy
};

// Bundles on their way.
struct bundle_walk {
    struct vec direction, along; // of their axes; along: |1/direction|
    struct cell_walk walk;
};

// Bundles beside a copy. Of the shape that all their rays have entered by `hi` (∞: there is none): which, across which
// axis, where the first of them may enter it (`lo`); where the first may enter another shape of the copy.
struct bundle_bounds {
    struct vec o; // the camera
    vfloat before, square,
        wide; // as of struct copy_packet, of their axes; how far from these rays are there
    vfloat lo, hi, others, shape, axis, away; // away: what none of them meets
};

// Shapes of a copy, a bit for each of those that float counts so; the others have none.
static inline unsigned shape_bit(int i, int first) {
    return i - first < 24 ? 1u << (i - first) : 0;
}

static inline struct vec local_direction(int first, const struct cell_grid *grid, int block) {
    return turned(&KNOWN(grid->scene)->primitives[first], grid->hits[block].direction);
}

// repetition/bundle_bounds.c
KERNEL_INLINE void bound_copy_entry(int first, const struct cell_grid *grid,
                                    const struct bundle_walk *b, struct vec o,
                                    struct bundle_bounds *bounds);

// repetition/copy_hit.c
KERNEL_INLINE vmask hit_copy(int first, const struct cell_grid *grid, int block, struct vec o,
                             struct vec rest, unsigned away, vmask active);
KERNEL_INLINE void hit_copy_by_all(int first, int shape, int axis, const struct cell_grid *grid,
                                   int block, struct vec o, struct vec rest);

#endif
