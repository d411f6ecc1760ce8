// Sets of shapes: lists here, bits in a generated kernel (kernel/kernel_scene.h of opt10_scene).
//
// A loop over a set:  UNROLL_SHAPES
//                     for (int k = 0; k < set_end(set); k++)
//                         if (set_has(set, k))
//                             visit(set_shape(set, k), ...);
#pragma once

#include <stdbool.h>

struct shape_set {
    int count;
    int *index; // with a BVH, room for LANES more than the scene has shapes (bvh_list)
};

static inline void set_list_room(struct shape_set *set, int *room) {
    set->index = room;
}

static inline void clear_set(struct shape_set *set) {
    set->count = 0;
}

static inline void add_to_set(struct shape_set *set, int i) {
    set->index[set->count++] = i;
}

static inline bool is_set_empty(const struct shape_set *set) {
    return set->count == 0;
}

static inline int set_end(const struct shape_set *set) {
    return set->count;
}

static inline bool set_has(const struct shape_set *set, int k) {
    (void)set;
    (void)k;
    return true;
}

// Returns the shape at place k of the set. Precondition: set_has(set, k).
static inline int set_shape(const struct shape_set *set, int k) {
    return set->index[k];
}
