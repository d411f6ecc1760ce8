// Vector words: everything that is computed for several rays at once is written in these, and built for as
// many lanes as LANES says: 16 (AVX-512), 8 (AVX2 and FMA) or 4 (SSE2); on aarch64 8 or 4 (NEON). Every word is
// correctly rounded or moves bits, so that a lane holds the same whatever the number of lanes and the machine, but
// for those marked (~).
// A file of one width cannot pass a vector to a file of another: each width is built apart.
//
//   vfloat                      a float in each lane; + - * / are the compiler's
//   v_splat(a)  v_load(p)  v_store(a, p)  v_lane0(a)  v_iota()    0, 1, 2 ... in the lanes
//   v_madd(a, b, c)  a*b + c    v_nmadd: c - a*b; v_msub: a*b - c. Rounded once; twice by SSE2 (~)
//   v_sqrt  v_abs  v_floor      v_round: to the nearest whole number, ties to even
//   v_min(a, b)  v_max(a, b)    b where either is NaN
//   v_reduce_min  v_reduce_max  a float: of all lanes; v_max_of_lanes: the maximum in every lane
//   v_copysign(a, sign)         the magnitude of a with the sign of `sign`
//   v_exponent(a)  v_mantissa(a)  of a > 0: a = mantissa * 2^exponent, 1 <= mantissa < 2
//   v_mantissa_near_1(a, &e)    the same with 3/4 <= mantissa < 3/2
//   v_ldexp(a, n)               a * 2^n for whole n, while that is a normal number
//   v_pow2_unit(a)              the power of 2 that scales a > 0 into 1 ... 2
//   v_rsqrt_approx  v_rcp_approx  the CPU's approximations: 14 bits with 16 lanes, 11 with 8 and 4, 15 by NEON (~)
//   v_rsqrt_newton(a)           1/sqrt(a) for normal a > 0: the approximation and one Newton step (~)
//   v_sqrt_below(a)             between sqrt(a)*(1 - 2^-10) and sqrt(a); NaN at 0 (~)
//
//   vmask                       a set of lanes: a type of its own
//   v_cmp_eq lt le gt ge        ordered comparisons: false where either operand is NaN
//   v_cmp_nlt ngt nge           unordered: "not less than" and so on, true where either operand is NaN
//   v_cmp_lt_in(m, a, b) ...    of the lanes of m alone: lt gt ge, nlt ngt nge
//   v_signbit(a)                lanes with a sign bit, -0 and NaN too
//   v_mask_none()  v_mask_all()  v_mask_first(n)
//   v_mask_bits(m)              bit i is lane i; v_mask_of_bits: the other way round
//   v_any  v_all  v_count       v_same(a, b): the same set; v_any_of_four(a, b, c, d): bit i, any lane of the i-th
//   v_and  v_or  v_not          v_andnot(a, b): b where not a
//   v_select(m, yes, no)        v_select_or_zero(m, a): a or 0; v_zero_where(m, a): 0 or a
//   v_negate_where(m, a)        v_madd_where(m, a, b, c): a*b + c or a
//   v_add_where(m, a, b)        a + b or a; outside of m, -0 may become 0 (~)
//
//   vhalf                       8 and 16 lanes: doubles for half of the lanes, as v_half_...; vdouble has both halves
//
// vectors.h: struct vec; with 8 and 16 lanes struct point, a sum of two floats, and doubles. powers.h: v_log, v_exp, v_pow,
// v_sin, v_cos.
//
// Lanes that change their place, with 8 and 16 lanes: rays are compacted, refilled and gathered by these.
// With 4 lanes there is v_compress_store alone; it writes as many floats as m has lanes.
//
//   vindex                             a whole number in each lane
//   v_compress_index(m)                the numbers of the lanes of m, in their order
//   v_permute_store(index, a, to)      writes LANES floats: lane index[i] of a as the i-th
//   v_compress_store(m, a, to)         the lanes of m in a row; LANES floats are written at most
//   v_compress_store_int(m, from, to)  the same of whole numbers; LANES are read and written
//   v_compress_store_lanes(m, first, shift, to)  first + 2^shift * lane of the lanes of m; LANES are written
//   v_index_u16(m, from)               from[i] in the lanes of m, from[0] in the others; LANES are read
//   v_gather(from, index)              from[index[i]] in lane i
//   v_expand_load(m, a, from)          a, but the lanes of m get the next floats from `from` on
//   v_expand_rows(to, count, lanes, from, stride)  the same for `count` vectors, whose floats stand in rows `stride`
//                                      apart. `lanes` are bits; with 16 lanes LANES floats are read of a row
//   v_move_lanes(to, there, from, here, count)  copies the lanes `here` of `count` vectors into the lanes `there` of
//                                      others, in their order; both have as many bits
//
// From three vectors (red, green, blue; a pixel a lane) to a picture of interleaved floats, with 8 and 16 lanes:
//
//   v_store_or_stream(to, stream, a)   stores a; stream: past the caches, `to` aligned to a vector
//   v_store_block(rgb, stride, r, g, b)  a block of 4 x LANES/4 pixels, its rows `stride` floats apart
//   v_load_block_row(from)             one row of neighbouring blocks that were stored one behind the other
//   v_store_row(rgb, stream, r, g, b)  LANES pixels of a row
#pragma once

#ifdef __aarch64__
#include <arm_neon.h>
#else
#include <immintrin.h>
#endif
#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#include "counting/flops.h"

#ifdef __aarch64__
#include "simd/neon.h"
#endif
#if LANES == 16
#include "simd/lanes16.h"
#include "simd/permute16.h"
#include "simd/rgb16.h"
#elif LANES == 8
#ifndef __aarch64__
#include "simd/lanes8.h"
#endif
#include "simd/permute8.h"
#include "simd/rgb8.h"
#elif LANES == 4
#ifndef __aarch64__
#include "simd/lanes4.h"
#endif
#else
#error "LANES: 4, 8 or 16; common/rules.mk sets it for the files of each_variant in phase.json"
#endif

#if LANES != 4
static inline void v_compress_store(vmask m, vfloat a, float to[LANES]) {
    v_permute_store(v_compress_index(m), a, to);
}
#endif

static inline vmask v_not(vmask a) {
    return v_andnot(a, v_mask_all());
}

#ifndef __aarch64__
static inline bool v_any(vmask a) {
    return v_mask_bits(a) != 0;
}

static inline bool v_all(vmask a) {
    return v_mask_bits(a) == (1u << LANES) - 1;
}
#endif

static inline bool v_same(vmask a, vmask b) {
    return v_mask_bits(a) == v_mask_bits(b);
}

static inline int v_count(vmask a) {
    return __builtin_popcount(v_mask_bits(a));
}

static inline vmask v_mask_first(int count) {
    return v_cmp_lt(v_iota(), v_splat((float)count));
}

#if LANES != 8 || defined __aarch64__
static inline unsigned v_any_of_four(vmask a, vmask b, vmask c, vmask d) {
    return (unsigned)v_any(a) | (unsigned)v_any(b) << 1 | (unsigned)v_any(c) << 2 |
           (unsigned)v_any(d) << 3;
}
#endif

static inline vfloat v_rsqrt_newton(vfloat a) {
    vfloat r = v_rsqrt_approx(a);
    return r * v_nmadd(a * r, r * v_splat(0.5f), v_splat(1.5f));
}

static inline vfloat v_sqrt_below(vfloat a) {
    const float room = LANES == 16 ? 0x1p-13f : 0x1p-11f; // more than the approximation's error
    return a * v_rsqrt_approx(a) * v_splat(1.0f - room);
}

#include "simd/powers.h"
#include "simd/vectors.h"
