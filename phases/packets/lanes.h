// The lane type: everything that is computed for several rays, or of several shapes, at once is written in these
// words, and built for as many lanes as LANES says: 16 (AVX-512), 8 (AVX2 and FMA), 4 (SSE2, as in the article).
//
//     real                          a float in each lane: + − × ÷ are the compiler's, others are below
//     set(a)  load(p)  unload(a, p)  first_of(a)  lane_numbers()
//     mul_add(a, b, c)              a·b + c, once rounded (SSE2 has no such thing: twice); neg_mul_add: c − a·b;
//                                   mul_sub: a·b − c
//     root(a)                       √a
//     newton_inverse_root(a)        1/√a for normal a > 0: the CPU's approximation and one step of Newton's; another
//                                   table on another CPU
//     absolute  whole_near          the nearest whole number, ties to even, of |a| < 2^31
//     least_of(a, b)  most_of(a, b) b where either is NaN
//     least_lane(a)  most_lane(a)   of all lanes
//     with_sign_of(from, a)         the magnitude of a with the sign of from
//     exponent_of(a)  mantissa_of(a)  the two fields of a > 0: a = mantissa·2^exponent, 1 ≤ mantissa < 2
//     scaled(a, n)                  a·2^n for whole n, while it stays a normal number
//     pack(m, a, p)                 the lanes of m in a row: at most LANES floats are written
//
//     mask                          which lanes: a type of its own, no real passes for one
//     less  greater  not_less       false where either is NaN; equal
//     no_lane()  lanes_of(bits)
//     both  either                  but_not(a, b): b where not a
//     bits(a)                       bit i is lane i; any(a)
//     choose(m, yes, no)            keep(m, a): a or 0; negate_where(m, a)
//
// Passing a real from code of one width to code of another is not possible: each width is built apart.
#ifndef PACKETS_LANES_H
#define PACKETS_LANES_H

#include <immintrin.h>
#include <math.h>
#include <stdbool.h>

#include "counting/flops.h"

#if LANES == 16
#include "lanes16.h"
#elif LANES == 8
#include "lanes8.h"
#elif LANES == 4
#include "lanes4.h"
#else
#error "LANES: 4, 8 or 16; common/rules.mk sets it for the files of each_variant in phase.json"
#endif

static inline bool any(mask a) {
    return bits(a) != 0;
}

static inline mask first_lanes(int count) {
    return lanes_of(count >= LANES ? (1u << LANES) - 1 : (1u << count) - 1);
}

static inline int count_of(mask a) {
    return __builtin_popcount(bits(a));
}

#endif
