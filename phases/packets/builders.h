// What the builders of the trees share. Both choose planes among BINS per axis.
#ifndef PACKETS_BUILDERS_H
#define PACKETS_BUILDERS_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tree.h"

enum { BINS = 16 };

static const struct box NOWHERE = {{INFINITY, INFINITY, INFINITY},
                                   {-INFINITY, -INFINITY, -INFINITY}};

static inline struct box joined(struct box a, const struct box *b) {
    for (int k = 0; k < 3; k++) {
        a.lo[k] = smaller(a.lo[k], b->lo[k]);
        a.hi[k] = larger(a.hi[k], b->hi[k]);
    }
    return a;
}

static inline float area_of(const struct box *b) {
    float x = b->hi[0] - b->lo[0], y = b->hi[1] - b->lo[1], z = b->hi[2] - b->lo[2];
    return x >= 0 ? x * y + y * z + z * x : 0;
}

// Room for one more of `size` bytes. False when memory is short.
static inline bool grow(void *array, int count, int *room, size_t size) {
    if (count < *room)
        return true;
    int wanted = *room ? 2 * *room : 64;
    void *old, *made;
    memcpy(&old, array, sizeof old);
    made = realloc(old, (size_t)wanted * size);
    if (!made)
        return false;
    memcpy(array, &made, sizeof made);
    *room = wanted;
    return true;
}

// The number of a new leaf of these; −1 when memory is short.
int add_leaf(struct tree *tree, const struct solid_in *solids, const int *which, int count);

// Over all solids, whose numbers are in `which`. False when memory is short.
bool build_bvh(struct tree *tree, const struct solid_in *solids, int *which,
               int count); // changes their order
bool build_kd(struct tree *tree, const struct solid_in *solids, const int *which, int count);

#endif
