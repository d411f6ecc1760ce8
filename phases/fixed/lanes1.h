// One lane: plain C. See number.h.
#ifndef FIXED_LANES1_H
#define FIXED_LANES1_H

#include <string.h>

typedef int64_t num;
typedef bool mask;

static inline num set(int64_t a) {
    return a;
}

static inline num ramp(void) {
    return 0;
}

static inline num plus(num a, num b) {
    return a + b;
}

static inline num minus(num a, num b) {
    return a - b;
}

static inline num product(num a, num b) {
    return (int64_t)(int32_t)a * (int32_t)b;
}

// Right, with the sign; left and right as bits, of any lane its own: by 64 or more, or less than 0, nothing is left.
static inline num shifted(num a, int by) {
    return a >> by;
}

static inline num shifted_each(num a, num by) {
    return a >> by;
}

static inline num left(num a, int by) {
    return (int64_t)((uint64_t)a << by);
}

static inline num right(num a, int by) {
    return (int64_t)((uint64_t)a >> by);
}

static inline num left_each(num a, num by) {
    return (uint64_t)by > 63 ? 0 : left(a, (int)by);
}

static inline num right_each(num a, num by) {
    return (uint64_t)by > 63 ? 0 : right(a, (int)by);
}

static inline num and_bits(num a, num b) {
    return a & b;
}

static inline num or_bits(num a, num b) {
    return a | b;
}

// The lower 32 bits are a float's, the others 0.
static inline num add_float(num bits, float a) {
    uint32_t low = (uint32_t)bits;
    float x;
    memcpy(&x, &low, sizeof x);
    x += a;
    memcpy(&low, &x, sizeof x);
    return low;
}

static inline num add_double(num bits, double a) {
    double x;
    memcpy(&x, &bits, sizeof x);
    x += a;
    memcpy(&bits, &x, sizeof x);
    return bits;
}

// The bits of the double nearest to a whole number ≥ 0.
static inline num as_double(num a) {
    double x = (double)a;
    memcpy(&a, &x, sizeof x);
    return a;
}

static inline mask positive(num a) {
    return a > 0;
}

static inline mask less(num a, num b) {
    return a < b;
}

static inline mask both(mask a, mask b) {
    return a && b;
}

static inline mask but_not(mask a, mask b) {
    return !a && b;
}

static inline mask either(mask a, mask b) {
    return a || b;
}

static inline bool any(mask a) {
    return a;
}

static inline bool bit_of(mask a, int lane) {
    (void)lane;
    return a;
}

static inline mask first_lanes(int count) {
    return count > 0;
}

static inline num choose(mask m, num yes, num no) {
    return m ? yes : no;
}

static inline num look_up(const int64_t *table, num at) {
    return table[at];
}

static inline mask bit_set(num a, int k) {
    return a >> k & 1;
}

static inline num load(const int64_t *from) {
    return *from;
}

static inline void unload_wide(num a, double scale, double *to) {
    *to = (double)a * scale;
}

static inline void unload(num a, double scale, float *to) {
    *to = (float)((double)a * scale);
}

#endif
