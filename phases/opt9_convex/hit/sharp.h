// Groups of solids without blends: entries and exits of the solids along a ray, in closed form (S. D. Roth, "Ray casting
// for modeling solids", Computer Graphics and Image Processing 18, 1982).
#pragma once

#include "core/prepared.h"

enum { SHARP_LEAVES = 24, SHARP_PARTS = 32 };

// What is in all of the leaves `kept` and in none of the leaves `cut`: bits by their numbers.
struct sharp_part {
    unsigned kept, cut;
};

// A group is the union of its parts (J. Goldfeather et al., "Near real-time CSG rendering using tree normalization and
// geometric pruning", IEEE Computer Graphics and Applications 9 (3), 1989). Leaves are convex solids, and half-spaces at which
// mirrors cut.
struct sharp {
    int leaves, parts;
    struct primitive leaf[SHARP_LEAVES];     // index: of its node; −1: of none
    const struct shape *shape[SHARP_LEAVES]; // of the model; NULL: a half-space
    struct sharp_part part[SHARP_PARTS];
    int balls;                  // `parts`, or 0: some part lies in no leaf's sphere
    float ball[SHARP_PARTS][4]; // each part lies in it, in the world: centre, radius
};
