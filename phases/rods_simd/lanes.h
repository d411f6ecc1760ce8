// The lane type: everything that is computed for several rays at once is written in these words, and built
// for as many lanes as LANES says. lanes8.h and lanes16.h say what each word is there; all of them are
// correctly rounded or move bits, so that a lane holds the same whatever the number of its neighbours.
//
//     real                          a float in each lane: + − × ÷ are the compiler's, others are below
//     set(a)  load(p)  unload(a, p)  first_of(a)
//     mul_add(a, b, c)              a·b + c, once rounded; neg_mul_add: c − a·b; mul_sub: a·b − c
//     root_below(a)                 some number between √a·(1 − 2^-10) and √a, not the same for each width: only for
//                                   what no lane's result depends on; NaN at 0
//     root  absolute  floor_of      whole_near: the nearest whole number, ties to even
//     least_of(a, b)  most_of(a, b) b where either is NaN
//     with_sign_of(from, a)         the magnitude of a with the sign of from
//     exponent_of(a)  mantissa_of(a)  the two fields of a > 0: a = mantissa·2^exponent, 1 ≤ mantissa < 2
//     scaled(a, n)                  a·2^n for whole n, while it stays a normal number
//
//     mask                          which lanes: a type of its own, no real passes for one
//     less  greater  not_less       false where either is NaN; below: true there; negative: the sign bit, of −0 and NaN too
//     no_lane()  all_lanes()
//     both  either  not_in(a)       but_not(a, b): b where not a
//     bits(a)                       bit i is lane i; any(a), all(a), same(a, b), count_of(a)
//     less_in(m, a, b)              of the lanes of m those where a < b; not_less_in, not_greater_in: where not
//     choose(m, yes, no)            keep(m, a): a or 0, drop(m, a): 0 or a; add_where(m, a, b): a + b or a
//     negate_where(m, a)
//
//     half                          doubles of half of the lanes: what vec.h's wide is made of
//
// Passing a real from code of one width to code of another is not possible: each width is built apart.
#ifndef RODS_SIMD_LANES_H
#define RODS_SIMD_LANES_H

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

// Lanes of a mask: what a counting build asks, and a timing build never does.
static inline int count_of(mask a) {
    return __builtin_popcount(bits(a));
}

#endif
