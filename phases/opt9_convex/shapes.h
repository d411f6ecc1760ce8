// Sets of shapes, as lists of any length, and loops over shapes. KNOWN is known.h's.
#ifndef OPT9_SHAPES_H
#define OPT9_SHAPES_H

#include <stdbool.h>

// A set of shapes.
struct shapes {
    int count,
        *index; // of a crowd there is room for LANES more than the scene has shapes (list_those)
};

static inline void give_room(struct shapes *set, int *room) {
    set->index = room;
}

static inline void none_of(struct shapes *set) {
    set->count = 0;
}

static inline void put_in(struct shapes *set, int i) {
    set->index[set->count++] = i;
}

static inline bool is_empty(const struct shapes *set) {
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
        rest_ &= ~v_mask_bits(same_shape(shape, shape_));                                          \
        visit(shape_, __VA_ARGS__);                                                                \
    }
#define EACH_ALIKE(scene, visit, first, ...)                                                       \
    for (int alike_ = (first); alike_ >= 0; alike_ = KNOWN(scene)->placed[alike_].alike)           \
    visit(alike_, first, __VA_ARGS__)

#endif
