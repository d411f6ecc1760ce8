// The lane type: everything that is computed for several rays at once is written in these words, and built
// for as many lanes as LANES says. lanes8.h and lanes16.h say what each word is there; all of them are
// correctly rounded or move bits, so that a lane holds the same whatever the number of its neighbours.
//
//     real                          a float in each lane: + − × ÷ are the compiler's, others are below
//     set(a)  load(p)  unload(a, p)  first_of(a)
//     put(p, past, a)               unload; past: the caches, and p is a multiple of a register's size
//     mul_add(a, b, c)              a·b + c, once rounded; neg_mul_add: c − a·b; mul_sub: a·b − c
//     root  absolute  floor_of      whole_near: the nearest whole number, ties to even
//     least_of(a, b)  most_of(a, b) b where either is NaN
//     with_sign_of(from, a)         the magnitude of a with the sign of from
//     exponent_of(a)  mantissa_of(a)  the two fields of a > 0: a = mantissa·2^exponent, 1 ≤ mantissa < 2
//     inverse_root  rough_inverse_root  root_guess  mantissa_near_1  twice_over_root
//     rooted (twice_root_times, divided_by): these are not rounded alike at both widths (Mandelbulbs; of
//                                   crowds a bound that leaves room)
//     power_per(a)                  the power of 2 that takes a > 0 to 1 … 2
//     move_lanes  store_row         lanes of rows into others; pixels of a row from three planes, one a lane
//     scaled(a, n)                  a·2^n for whole n, while it stays a normal number
//
//     mask                          which lanes: a type of its own, no real passes for one
//     less  greater  not_less       false where either is NaN; negative: the sign bit, of −0 and NaN too
//     no_lane()  all_lanes()  first_lanes(n)
//     both  either  not_in(a)       but_not(a, b): b where not a
//     less_in(m, a, b)              of the lanes of m those where a < b; greater_in, not_less_in
//     but_less(m, a, b)             of the lanes of m those where not a < b; but_greater, but_not_less
//     bits(a)                       bit i is lane i; any(a), all(a), count_of(a)
//     any_of_four(a, b, c, d)       bit i: any lane of the i-th
//     choose(m, yes, no)            keep(m, a): a or 0, drop(m, a): 0 or a
//     negate_where(m, a)
//
//     half                          doubles of half of the lanes: what vec.h's wide is made of
//
// Passing a real from code of one width to code of another is not possible: each width is built apart.
#ifndef OPT9_LANES_H
#define OPT9_LANES_H

#include <immintrin.h>
#include <math.h>
#include <stdbool.h>

#include "counting/flops.h"

#if LANES == 16
#include "lanes16.h"
#elif LANES == 8
#include "lanes8.h"
#else
#error "LANES: 8 or 16; common/rules.mk sets it for the files of each_variant in phase.json"
#endif

static inline mask not_in(mask a) {
    return but_not(a, all_lanes());
}

static inline bool any(mask a) {
    return bits(a) != 0;
}

static inline bool all(mask a) {
    return bits(a) == (1u << LANES) - 1;
}

// Lanes of a mask: what a counting build asks, and a timing build never does.
static inline int count_of(mask a) {
    return __builtin_popcount(bits(a));
}

// 0, 1, 2 …
static inline real lane_numbers(void) {
    static const float numbers[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    return load(numbers);
}

static inline mask first_lanes(int count) {
    return less(lane_numbers(), set((float)count));
}

#endif
