// One lane: plain C. number.h says what each operation is.
// tile.c is built once, with LANES and VARIANT as here.
#pragma once

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define LANES 1
#define VARIANT(name) lanes1_##name

typedef int64_t vnum;
typedef bool vmask;

static inline vnum v_splat(int64_t a) {
    return a;
}

static inline vnum v_iota(void) {
    return 0;
}

#define OF_TWO(result, name, type, expression)                                                     \
    static inline result name(type a, type b) {                                                    \
        return expression;                                                                         \
    }
OF_TWO(vnum, v_add, vnum, a + b)
OF_TWO(vnum, v_sub, vnum, a - b)
OF_TWO(vnum, v_mul_wide, vnum, (int64_t)(int32_t)a *(int32_t)b)
OF_TWO(vnum, v_and_bits, vnum, a &b)
OF_TWO(vnum, v_or_bits, vnum, a | b)
OF_TWO(vnum, v_srav, vnum, a >> b)
OF_TWO(vmask, v_cmp_lt, vnum, a < b)
OF_TWO(vmask, v_and, vmask, a &&b)
OF_TWO(vmask, v_or, vmask, a || b)
OF_TWO(vmask, v_andnot, vmask, !a && b)

// v_sra, v_srav keep the sign; the other shifts move bits. By more than 63 bits or less than 0 nothing is left.
static inline vnum v_sra(vnum a, int by) {
    return a >> by;
}

static inline vnum v_sll(vnum a, int by) {
    return (int64_t)((uint64_t)a << by);
}

static inline vnum v_srl(vnum a, int by) {
    return (int64_t)((uint64_t)a >> by);
}

static inline vnum v_sllv(vnum a, vnum by) {
    return (uint64_t)by > 63 ? 0 : v_sll(a, (int)by);
}

static inline vnum v_srlv(vnum a, vnum by) {
    return (uint64_t)by > 63 ? 0 : v_srl(a, (int)by);
}

// Adds `a` to the float in the lower 32 bits; the upper 32 bits are 0 before and after.
static inline vnum v_add_float(vnum bits, float a) {
    uint32_t low = (uint32_t)bits;
    float x;
    memcpy(&x, &low, sizeof x);
    x += a;
    memcpy(&low, &x, sizeof x);
    return low;
}

static inline vnum v_add_double(vnum bits, double a) {
    double x;
    memcpy(&x, &bits, sizeof x);
    x += a;
    memcpy(&bits, &x, sizeof x);
    return bits;
}

// Returns the bits of the double nearest to an integer ≥ 0.
static inline vnum v_double_bits(vnum a) {
    double x = (double)a;
    memcpy(&a, &x, sizeof x);
    return a;
}

static inline vmask v_positive(vnum a) {
    return a > 0;
}

static inline bool v_any(vmask a) {
    return a;
}

static inline bool v_mask_lane(vmask a, int lane) {
    (void)lane;
    return a;
}

static inline vmask v_mask_first(int count) {
    return count > 0;
}

static inline vnum v_select(vmask m, vnum yes, vnum no) {
    return m ? yes : no;
}

static inline vnum v_lookup(const int64_t *table, vnum at) {
    return table[at];
}

static inline vmask v_test_bit(vnum a, int k) {
    return a >> k & 1;
}

static inline vnum v_load(const int64_t *from) {
    return *from;
}

static inline void v_store_double(vnum a, double scale, double *to) {
    *to = (double)a * scale;
}

static inline void v_store_float(vnum a, double scale, float *to) {
    *to = (float)((double)a * scale);
}
