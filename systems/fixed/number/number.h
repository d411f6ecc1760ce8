// Fixed-point arithmetic in lanes, one ray in each: 64-bit integers with format->bits bits of fraction, after
// N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017). tile.c is written in these operations alone, so
// that other phases change lanes.h (8 and 16 lanes: fixed_simd) or this file (floats: fixed_float).
//
// From lanes.h, lane by lane:
//     vnum  vmask               the numbers; which lanes. Factors of a product have 32 bits: every number's range
//     v_splat(a)  v_iota()      a in each lane; 0, 1, 2 … from the first lane on
//     v_add  v_sub              sums
//     v_mul_wide(a, b)          32 × 32 → 64 bits, not yet shifted
//     v_sra(a, n)  v_srav(a, b) shift right with the sign, by one number or by each lane's own
//     v_sll v_srl v_sllv v_srlv shifts of bits; by more than 63 bits or less than 0 nothing is left
//     v_and_bits  v_or_bits     bits
//     v_cmp_lt  v_positive      a < b; a > 0
//     v_and  v_or  v_andnot     of masks; v_andnot(a, b): b where not a
//     v_any(m)  v_mask_lane(m, i)  v_mask_first(n)
//     v_select(m, yes, no)      yes where m, else no
//     v_lookup(table, at)       table[at]; v_test_bit(a, k): lanes whose whole number has bit k set
//     v_load(p)  v_store_float(a, scale, p)  v_store_double: stored times scale
// From this file and roots.h:
//     v_mul(a, b, f)            a·b; v_dot(a, b, f): a·x + b·y + c·z, shifted once, as in the article
//     v_half(a)  v_max(a, b)    v_half rounds down, as every shift does
//     v_root(a, f)              √a; normalize(v, f, &r): v/|v|, and 1/|v| in r; times_reciprocal(a, r): a/|v|
#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "number/format.h"
#include "number/lanes.h"

struct vec {
    vnum x, y, z;
};

static const int64_t LARGEST_FACTOR = INT32_MAX; // that v_mul_wide takes

// Returns a·b, rounded down to the format's last bit. Both must be factors, below 2^31.
static inline vnum v_mul(vnum a, vnum b, const struct format *f) {
    return v_sra(v_mul_wide(a, b), f->bits);
}

static inline struct vec vec_sub(struct vec a, struct vec b) {
    return (struct vec){v_sub(a.x, b.x), v_sub(a.y, b.y), v_sub(a.z, b.z)};
}

// Returns the dot product, rounded down once. The products are summed in 64 bits before the shift.
static inline vnum v_dot(struct vec a, struct vec b, const struct format *f) {
    vnum sum = v_add(v_add(v_mul_wide(a.x, b.x), v_mul_wide(a.y, b.y)), v_mul_wide(a.z, b.z));
    return v_sra(sum, f->bits);
}

static inline vnum v_half(vnum a) {
    return v_sra(a, 1);
}

static inline vnum v_max(vnum a, vnum b) {
    return v_select(v_cmp_lt(a, b), b, a);
}

#include "number/roots.h"
