// What trace.c and alone.c share: rays under way through the tree.
#ifndef PACKETS_QUERY_H
#define PACKETS_QUERY_H

#include "trace.h"

struct query {
    const struct prepared *scene;
    const struct beams *beams;
    float *t, *shape; // as they come out; blocked(): no shape
    bool any;         // asked for is whether, not where
    bool newton;
};

static inline vmask active_in(const struct beams *b, int packet) {
    return v_mask_first(b->count - packet * LANES);
}

// What of a solid's interval counts as a hit of a ray from outside, or from inside.
static inline vmask entered(vmask met, vfloat in, vfloat out, struct vec o, enum solid type,
                            const struct hot *hot, int i, enum lane_of lane, vfloat *t) {
    COUNT(entered, call);
    vfloat zero = v_splat(0.0f);
    met = v_and(met, v_cmp_gt(out, zero));
    *t = in;
    vmask within = v_andnot(v_cmp_gt(in, zero), met);
    if (v_any(within)) {
        COUNT(entered, within);
        *t = v_select(within, v_min(depth_in(type, o, hot, i, lane), zero), in);
    }
    return met;
}

// Children to be looked into, the nearest on top.
struct waiting {
    int child;
    float begin;
};
enum { STACK = MOST_DEPTH * MOST_LANES };

// Puts the children in `which` onto the stack, the furthest first.
static inline int push(struct waiting *stack, int count, unsigned which, vfloat begin,
                       const int *child) {
    float at[LANES];
    v_store(begin, at);
    int bottom = count;
    for (; which; which &= which - 1) {
        int i = __builtin_ctz(which), j = count++;
        for (; j > bottom && stack[j - 1].begin < at[i]; j--)
            stack[j] = stack[j - 1];
        stack[j] = (struct waiting){child[i], at[i]};
    }
    return count;
}

// alone.c: ray i through the tree by itself. `margin`: by what a box may be off, but for the ray's origin.
void go_alone(const struct query *q, int i, float margin);

#endif
