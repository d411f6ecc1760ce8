// Where the rays of a packet need a part of a group's program only: in opt7_tiles.
#pragma once

#include "simd/simd.h"

struct region;

// The packet's rays have changed.
static inline void forget_region(struct region *r) {
    (void)r;
}

// After that: the rays are the same, but begin at t of before.
static inline void recall_region(struct region *r, vfloat t) {
    (void)r;
    (void)t;
}
