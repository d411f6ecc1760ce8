// What the code knows of its scene when it is compiled: here nothing, so that every scene can be drawn.
// Code that is compiled for one scene has a header of its own in place of this one.
#ifndef OPT9_KNOWN_H
#define OPT9_KNOWN_H

#include "placed.h"

// The scene as `const struct known *`.
#define KNOWN(scene) (&(scene)->known)
#define IS_CROWD(scene) ((scene)->tree.levels > 0)
// Functions with code of their own for each shape; called from another file; and those of them that a crowd calls, too.
#define INLINE static inline
#define SHARED
#define CROWD_SHARED
// A shininess that all shapes have, a whole number, or 0; whether all shapes look alike.
enum { WHOLE_SHININESS = 0, ONE_MATERIAL = 0 };
// Packets of shadow rays that are marched by turns, and whether one that is over makes room for the next at once (umbra.c).
enum { CASTS = 2, REFILL_CASTS = 0 };

// Whether a direction is known to be (0, 1, 0).
static inline bool is_up(const float a[3]) {
    (void)a;
    return false;
}

// A set of shapes.
struct shapes {
    int count, *index; // of a crowd there is room for LANES more than the scene has shapes (list_those)
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
    for (unsigned rest_ = bits(m); rest_;) {                                                       \
        int shape_ = (int)lane_of(shape, __builtin_ctz(rest_));                                    \
        rest_ &= ~bits(same_shape(shape, shape_));                                                 \
        visit(shape_, __VA_ARGS__);                                                                \
    }
#define EACH_ALIKE(scene, visit, first, ...)                                                       \
    for (int alike_ = (first); alike_ >= 0; alike_ = KNOWN(scene)->placed[alike_].alike)           \
    visit(alike_, first, __VA_ARGS__)

#endif
