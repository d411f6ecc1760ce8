// A ray's way from cell to cell of a repeated shape: see repetition/repeated_rays.c.
#ifndef OPT9_WALK_H
#define OPT9_WALK_H

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

struct walk {
    struct cell_axis x, y, z;
    vfloat end;
};

// Into the next cells; those that are not at their end there.
static inline vmask next_cells(struct walk *w, vmask going) {
    ACTIVE(v_count(going));
    COUNT(next_cells, call);
    vfloat leaves = cell_exit(&w->x, &w->y, &w->z);
    going = v_and(going, v_cmp_lt(leaves, w->end));
    next_on_axis(&w->x, going, leaves);
    next_on_axis(&w->y, going, leaves);
    next_on_axis(&w->z, going, leaves);
    return going;
}

static inline vfloat box_entry(const struct walk *w) {
    return v_max(w->x.middle - w->x.half, v_max(w->y.middle - w->y.half, w->z.middle - w->z.half));
}

// Where the rays meet the next box; of `skip` not the first.
static inline vmask next_box(struct walk *w, vmask going, vmask skip) {
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

#endif
