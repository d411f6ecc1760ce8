// The walk of rays (repetition/repeated_rays.c) and of bundles of camera rays (repetition/repeated_bundles.c)
// from cell to cell of a repeated shape.
#pragma once

#include "hit/solids.h"
#include "repetition/repeated_rays.h"
#include "types/sdf.h"
#include "types/shading_packet.h"
#include "types/tile_context.h"

// One axis of a walk. The ray passes the middle of its cell at t = middle = base + count·step, the box about
// the copy within `half` of that, and the cell within `wall`. size: t per unit of this coordinate.
struct cell_axis {
    vfloat base, step, half, wall, count, middle, size;
};

static inline struct cell_axis cell_axis_of(vfloat o, vfloat d, float cell, float half) {
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

// Moves the rays `going` into their next cells. Returns those that have not reached their end.
static inline vmask next_cells(struct cell_walk *w, vmask going) {
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

// Walks the rays `going` to the next box that they meet. Returns those that meet one. Rays of `skip` pass
// over the box of their first cell.
static inline vmask next_box(struct cell_walk *w, vmask going, vmask skip) {
    vmask met = v_mask_none();
    while (v_any(going)) {
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
    BUNDLE_HEIGHT = 4, // pixels; a bundle is as wide as a block
    BUNDLE_BLOCKS = BUNDLE_HEIGHT / BLOCK_HEIGHT,
    BUNDLES = BLOCKS_ACROSS * TILE_HEIGHT / BUNDLE_HEIGHT
};

_Static_assert(BUNDLES % LANES == 0, "whole registers");

// The cells of repeated shapes that share a grid, and the camera rays of a tile among them.
struct cell_grid {
    const struct prepared *scene;
    double eye[3], size[3];
    float spread, bounds, slack; // spread: of a bundle, per unit of t. slack: rounding of a point
    bool only_grid, first; // only_grid: the scene has no other grid. first: no ray has a hit yet
    struct primary_hit *hits;
    vmask left[BLOCKS]; // rays that have not hit a copy
};

// Bundles that walk from cell to cell, one per lane.
struct bundle_walk {
    struct vec direction, along; // direction: of a bundle's axis; along: |1/direction|
    struct cell_walk walk;
};

// Bounds of bundles at the copy in their cells. All rays enter the nearest shape between lo and hi (infinite:
// no such shape), through the face across `axis`. Another shape may be entered from t = others on.
struct bundle_bounds {
    struct vec o; // the camera, in the copy's frame
    vfloat before, square,
        wide; // before, square: see struct copy_packet. wide: distance of any ray from the axis there
    vfloat lo, hi, others, shape, axis, away; // away: shapes that no ray hits, as shape bits
};

// Returns a bit for shape i of the grid of `first`: 24 bits, exact in a float. Further shapes have none.
static inline unsigned shape_bit(int i, int first) {
    return i - first < 24 ? 1u << (i - first) : 0;
}

static inline struct vec local_direction(int first, const struct cell_grid *grid, int block) {
    return turned(&KNOWN(grid->scene)->primitives[first], grid->hits[block].direction);
}

// repetition/bundle_bounds.c. Sets the bounds of bundles at copies seen from o, in their frames.
KERNEL_INLINE void bound_copy_entry(int first, const struct cell_grid *grid,
                                    const struct bundle_walk *b, struct vec o,
                                    struct bundle_bounds *bounds);

// repetition/copy_hit.c. hit_copy() intersects the rays `active` of a block with the copy seen from o + rest,
// without the shapes of `away`, and returns the rays that hit it. hit_copy_by_all() does so for a copy that
// all rays of the block are proved to hit, on one face or one sphere.
KERNEL_INLINE vmask hit_copy(int first, const struct cell_grid *grid, int block, struct vec o,
                             struct vec rest, unsigned away, vmask active);
KERNEL_INLINE void hit_copy_by_all(int first, int shape, int axis, const struct cell_grid *grid,
                                   int block, struct vec o, struct vec rest);
