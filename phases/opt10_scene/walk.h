// A ray's way from cell to cell of a repeated shape: see cells.c.
#ifndef OPT10_WALK_H
#define OPT10_WALK_H

#include "cells.h"

// One axis: the ray is at the middle of its cell at `middle` = base + count·step, and there within `half` of the
// box about the copy, within `wall` of the cell. All in units of t, of which `size` are as long as 1 along it.
struct axis {
    real base, step, half, wall, count, middle, size;
};

static inline struct axis axis_of(real o, real d, float cell, float half) {
    COUNT(axis_of, call);
    COUNT(axis_of, scalar);
    real zero = set(0.0f), per = inverse_of(d), size = absolute(per), base = zero - o * per;
    real wall = set(0.5f * cell) * size;
    if (!(cell > 0.0f))
        wall = set(INFINITY);
    return (struct axis){base, set(cell) * size, set(half) * size, wall, zero, base, size};
}

static inline real leaves_at(const struct axis *x, const struct axis *y, const struct axis *z) {
    return least_of(x->middle + x->wall, least_of(y->middle + y->wall, z->middle + z->wall));
}

static inline void go_on(struct axis *a, mask going, real leaves) {
    mask through = both(going, not_less(leaves, a->middle + a->wall));
    a->count = a->count + keep(through, set(1.0f));
    a->middle = mul_add(a->count, a->step, a->base);
}

struct walk {
    struct axis x, y, z;
    real end;
};

// Into the next cells; those that are not at their end there.
static inline mask next_cells(struct walk *w, mask going) {
    ACTIVE(count_of(going));
    COUNT(next_cells, call);
    real leaves = leaves_at(&w->x, &w->y, &w->z);
    going = both(going, less(leaves, w->end));
    go_on(&w->x, going, leaves);
    go_on(&w->y, going, leaves);
    go_on(&w->z, going, leaves);
    return going;
}

static inline real into_box(const struct walk *w) {
    return most_of(w->x.middle - w->x.half,
                   most_of(w->y.middle - w->y.half, w->z.middle - w->z.half));
}

// Where the rays meet the next box; of `skip` not the first.
static inline mask next_box(struct walk *w, mask going, mask skip) {
    COUNT(next_box, call);
    mask met = no_lane();
    while (any(going)) {
        ACTIVE(count_of(going));
        COUNT(next_box, cell);
        real in = into_box(w);
        real out = least_of(w->x.middle + w->x.half,
                            least_of(w->y.middle + w->y.half, w->z.middle + w->z.half));
        mask here =
            both(both(going, not_less(out, in)), both(greater(out, set(0.0f)), less(in, w->end)));
        here = but_not(skip, here);
        skip = no_lane();
        met = either(met, here);
        going = next_cells(w, but_not(here, going));
    }
    return met;
}

#endif
