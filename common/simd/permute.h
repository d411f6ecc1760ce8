// Lanes that change their place, with 8 and 16 lanes: rays are compacted, refilled and gathered by these.
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
// With 4 lanes there is v_compress_store alone; it writes as many floats as m has lanes.
#ifndef SIMD_PERMUTE_H
#define SIMD_PERMUTE_H

#include "simd/simd.h"

#if LANES == 16
#include "simd/permute16.h"
#elif LANES == 8
#include "simd/permute8.h"
#else
static inline void v_compress_store(vmask m, vfloat a, float to[LANES]) {
    float lanes[LANES];
    v_store(a, lanes);
    for (unsigned rest = v_mask_bits(m); rest; rest &= rest - 1)
        *to++ = lanes[__builtin_ctz(rest)];
}
#endif

#if LANES > 4
static inline void v_compress_store(vmask m, vfloat a, float to[LANES]) {
    v_permute_store(v_compress_index(m), a, to);
}
#endif

#endif
