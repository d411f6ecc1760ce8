// What the traversals of bundles (bundle.c) and of single rays (single_ray.c) share.
#pragma once

#include "simd/simd.h"
#include "trace.h"

// A batch under way through the tree.
struct query {
    const struct prepared *scene;
    const struct ray_batch *batch;
    float *t, *shape; // results so far; `shape` is not used if `occlusion`
    bool occlusion;   // whether a ray is blocked, not where
    bool newton;
};

static inline vmask active_lanes(const struct ray_batch *b, int packet) {
    int rays = b->count - packet * LANES; // v_mask_first() takes 1.3 times as long by 8 lanes
    return v_mask_of_bits(rays < LANES ? (1u << rays) - 1 : (1u << LANES) - 1);
}

// Takes hits at t of the shape `mine`, of the rays from `first` on, where they are nearer: of equal distances that of the
// lower index.
static inline void take_nearer(const struct query *q, int first, vmask met, vfloat t, vfloat mine) {
    vfloat best = v_load(q->t + first), shape = v_load(q->shape + first);
    met = v_and(met, v_or(v_cmp_lt(t, best), v_and(v_cmp_eq(t, best), v_cmp_lt(mine, shape))));
    v_store(v_select(met, t, best), q->t + first);
    v_store(v_select(met, mine, shape), q->shape + first);
}

// A child that waits on the traversal's stack, the nearest on top.
struct stack_entry {
    int child;
    float begin;
};
enum { STACK_SIZE = MAX_DEPTH * MAX_LANES };

// Pushes the children in `which`, the farthest first. Returns the new count.
static inline int push_children(struct stack_entry *stack, int count, unsigned which, vfloat begin,
                                const int *child) {
    float at[LANES];
    v_store(begin, at);
    int bottom = count;
    for (; which; which &= which - 1) {
        int i = __builtin_ctz(which), j = count++;
        for (; j > bottom && stack[j - 1].begin < at[i]; j--)
            stack[j] = stack[j - 1];
        stack[j] = (struct stack_entry){child[i], at[i]};
    }
    return count;
}

// bundle.c: traces the rays together through the tree, unless they diverge. `always`: also if many
// solids are expected in their frustum. Returns whether it traced them.
bool trace_bundle(const struct query *q, bool always);

// bundle.c: tests every ray against every solid.
void trace_all_solids(const struct query *q);

// single_ray.c: traces ray i by itself. `margin`: rounding of a box's planes, without the origin's.
void trace_single_ray(const struct query *q, int i, float margin);
