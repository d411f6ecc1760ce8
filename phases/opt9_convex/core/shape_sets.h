// Sets of shapes, as lists of any length, and loops over shapes. KNOWN is core/known_scene.h's.
#ifndef OPT9_SHAPE_SETS_H
#define OPT9_SHAPE_SETS_H

#include <stdbool.h>

// A set of shapes.
struct shape_set {
    int count,
        *index; // of a crowd there is room for LANES more than the scene has shapes (bvh_list)
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

// visit(i, …) for every shape; for each shape of a set; for each shape that a lane of the mask m is on; and for the
// shape `first` and every other that is repeated in the same cells.
#define EACH_SHAPE(scene, visit, ...)                                                              \
    for (int shape_ = 0; shape_ < KNOWN(scene)->model.shape_count; shape_++)                       \
    visit(shape_, __VA_ARGS__)
#define EACH_IN(set, visit, ...)                                                                   \
    for (int k_ = 0; k_ < (set).count; k_++)                                                       \
    visit((set).index[k_], __VA_ARGS__)
#define EACH_HIT(m, shape, scene, visit, ...)                                                      \
    for (unsigned rest_ = v_mask_bits(m); rest_;) {                                                \
        int shape_ = (int)lane_of(shape, __builtin_ctz(rest_));                                    \
        rest_ &= ~v_mask_bits(is_shape(shape, shape_));                                            \
        visit(shape_, __VA_ARGS__);                                                                \
    }
#define EACH_ALIKE(scene, visit, first, ...)                                                       \
    for (int alike_ = (first); alike_ >= 0;                                                        \
         alike_ = KNOWN(scene)->primitives[alike_].next_same_grid)                                 \
    visit(alike_, first, __VA_ARGS__)

#endif
