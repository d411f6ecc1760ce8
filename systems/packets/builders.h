// What the tree's builders share: boxes, arrays that grow, and leaves.
#pragma once

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tree.h"

enum { BINS = 16 }; // per axis; a split is one of the planes between them

static const struct box EMPTY_BOX = {{INFINITY, INFINITY, INFINITY},
                                     {-INFINITY, -INFINITY, -INFINITY}};

static inline struct box box_union(struct box a, const struct box *b) {
    for (int k = 0; k < 3; k++) {
        a.lo[k] = float_min(a.lo[k], b->lo[k]);
        a.hi[k] = float_max(a.hi[k], b->hi[k]);
    }
    return a;
}

static inline float box_area(const struct box *b) {
    float x = b->hi[0] - b->lo[0], y = b->hi[1] - b->lo[1], z = b->hi[2] - b->lo[2];
    return x >= 0 ? x * y + y * z + z * x : 0;
}

// Makes room for one more element of `size` bytes in *array, a pointer. Returns false if memory is
// short.
static inline bool reserve_one(void *array, int count, int *room, size_t size) {
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

// leaves.c: adds a leaf of the solids whose numbers are in `which`. Returns its number, −1 if
// memory is short.
int add_leaf(struct tree *tree, const struct bounded_solid *solids, const int *which, int count);

// bvh.c, kd.c: build the tree over the solids whose numbers are in `which`; build_bvh sorts these.
// Return false if memory is short.
bool build_bvh(struct tree *tree, const struct bounded_solid *solids, int *which, int count);
bool build_kd(struct tree *tree, const struct bounded_solid *solids, const int *which, int count);
