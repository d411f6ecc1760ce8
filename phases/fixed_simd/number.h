// Numbers and the words in which everything is computed with them: fixed point in int64 lanes, after N. L.
// Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017). The sources that use these words are the same for
// one lane (phase fixed), 8 and 16 (fixed_simd) and for floats (fixed_float): what differs is this file and lanesN.h.
//
//     num                       an integer of 64 bits in each lane; with `bits` of fraction, as a rule, and in units of
//                               the format. A factor of a product is of 32 bits: that is every number's range
//     mask                      which lanes
//     set(a)  ramp()            a in each lane; 0, 1, 2 … from the first lane on
//     plus  minus  half_of      half_of: rounds down, as every shift here does
//     product(a, b)             32 × 32 → 64 bits, not yet shifted
//     times(a, b, f)            a·b; sum3(…, f): a·x + b·y + c·z with one shift at the end, as the article stacks them
//     positive  less            choose(m, yes, no)  both  but_not(a, b): b where not a
//     any(m)  bit_of(m, i)      whether the lane i is among them
//     root(a, f)                √a; normalised(v, f, &per): v/|v| and 1/|v|, which over(a, per) takes: a/|v|: roots.h
//     look_up(table, at)        table[at] of each lane; bit_set(a, k): lanes whose whole number has that bit
//     unload(a, scale, to)      as floats, times scale; unload_wide: as doubles
#ifndef FIXED_NUMBER_H
#define FIXED_NUMBER_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "format.h"

#if LANES == 16
#include "lanes16.h"
#elif LANES == 8
#include "lanes8.h"
#else
#error "LANES: 8 or 16; common/rules.mk sets it for the files of each_variant in phase.json"
#endif

struct vec {
    num x, y, z;
};

static inline num times(num a, num b, const struct format *f) {
    return shifted(product(a, b), f->bits);
}

static inline num sum3(struct vec a, struct vec b, const struct format *f) {
    num sum = plus(plus(product(a.x, b.x), product(a.y, b.y)), product(a.z, b.z));
    return shifted(sum, f->bits);
}

static inline num half_of(num a) {
    return shifted(a, 1);
}

static inline num greatest(num a, num b) {
    return choose(less(a, b), b, a);
}

static const int64_t MOST = INT32_MAX; // that a factor of a product may be

#include "roots.h"

#endif
