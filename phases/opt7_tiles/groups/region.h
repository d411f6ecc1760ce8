// Where the rays of a packet need a part of a group's program only.
#pragma once

#include "simd/simd.h"

struct program; // groups/program.h
struct step;

// A part of a group's program, for the rays of a packet. Packets that march together share the first one's.
struct region {
    vfloat until, before; // t up to which the part holds; of the rays before
    struct region *owner; // whose program it is
    unsigned serial;      // of the owner's program: it changes whenever the program does
    unsigned owned;       // of this region's own program
    struct program *program;
    struct step *steps; // the program's room
};

// The packet's rays have changed.
static inline void forget_region(struct region *r) {
    r->before = r->until;
    r->until = v_splat(-INFINITY);
}

// After that: the rays are the same, but begin at t of before.
static inline void recall_region(struct region *r, vfloat t) {
    r->until = r->before - t;
}
