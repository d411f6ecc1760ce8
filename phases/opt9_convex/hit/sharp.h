// Groups of solids without blends: entries and exits of the solids along a ray, in closed form (S. D. Roth, "Ray casting
// for modeling solids", Computer Graphics and Image Processing 18, 1982).
#pragma once

#include "core/prepared.h"

enum { SHARP_LEAVES = 24, SHARP_STEPS = 4 * SHARP_LEAVES };

// Steps of an expression over the sets of rays that are inside of leaves, in postfix form: a leaf's number, or one of
// these, which take the last two sets.
enum { SHARP_AND = -1, SHARP_OR = -2, SHARP_WITHOUT = -3 };

// Leaves are solids, and half-spaces at which mirrors cut. removes: the group's surface there is where a ray leaves it.
// guard: an earlier leaf, without which a ray has no use for this one; −1: none.
// holds: the leaf holds all of its guard's solid that the group has.
struct sharp {
    int leaves, steps;
    struct primitive leaf[SHARP_LEAVES];
    const struct shape *shape[SHARP_LEAVES]; // of the model; NULL: a half-space
    bool removes[SHARP_LEAVES];
    signed char guard[SHARP_LEAVES];
    bool holds[SHARP_LEAVES];
    signed char step[SHARP_STEPS];
};
