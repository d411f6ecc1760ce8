// Numbers and the words in which everything is computed with them: floats in lanes, in the place of phase fixed_simd's
// fixed point; the sources that use these words are the same. A float has its own exponent: what shifts a fixed-point
// number does nothing here.
//
//     num                       a float in each lane; lengths in scene units
//     mask                      which lanes
//     set(a)  ramp()            a in each lane; 0, 1, 2 … from the first lane on
//     plus  minus  product  times   sum3(…): a·x + b·y + c·z by fused products
//     positive  less            choose(m, yes, no)  both  but_not(a, b): b where not a
//     any(m)  bit_of(m, i)      whether the lane i is among them; count_of(m): how many there are
//     root(a, f)                √a; normalised(v, f, &per): v/|v| and 1/|v|, by root and division; over(a, per): a/|v|
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

static const float MOST = 0x1p31f; // where fixed point ends, so that both cap alike

struct vec {
    num x, y, z;
};

static inline num shifted(num a, int by) {
    (void)by;
    return a;
}

static inline num times(num a, num b, const struct format *f) {
    (void)f;
    return a * b;
}

static inline num sum3(struct vec a, struct vec b, const struct format *f) {
    (void)f;
    return mul_add(a.z, b.z, mul_add(a.y, b.y, a.x * b.x));
}

static inline num root(num a, const struct format *f) {
    (void)f;
    return root_of(a);
}

struct per {
    num factor;
};

static inline num over(num a, struct per per) {
    return a * per.factor;
}

static inline struct vec normalised(struct vec v, const struct format *f, struct per *per) {
    num square = sum3(v, v, f), least = set(1e-30f);
    num x = set(1) / root_of(choose(less(square, least), least, square));
    per->factor = x;
    return (struct vec){v.x * x, v.y * x, v.z * x};
}

#endif
