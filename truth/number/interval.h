// Intervals of doubles (ivd) and of quads (ivq) that enclose the exact value.
//
// Round to nearest throughout, then one step outward: S. M. Rump, P. Zimmermann, S. Boldo,
// G. Melquiond, "Computing predecessor and successor in rounding to nearest", BIT 49 (2009). No
// rounding mode is changed: a compiler cannot move an operation across the change, threads need no
// set-up, and libgcc's quads follow the same rules. An exact sum is not widened (D. E. Knuth's
// error-free sum). Neither is a product by 0 or ±1, nor a quad product of two doubles. So what is
// exact in a scene (axes, whole numbers) stays exact and can be decided.
#pragma once

#include <math.h>
#include <stdbool.h>

#include "number/quad.h"

static inline double sqrt_near_d(double x) {
    return sqrt(x);
}

// Returns √x for x > 0 within a few units of the last place: two Newton steps from the double root.
static inline quad sqrt_near_q(quad x) {
    quad scale = 1, back = 1;
    while (x * scale < (quad)0x1p-900)
        scale *= (quad)0x1p800, back *= (quad)0x1p-400;
    while (x * scale > (quad)0x1p900)
        scale *= (quad)0x1p-800, back *= (quad)0x1p400;
    x *= scale;
    quad r = (quad)sqrt((double)x);
    r = (r + x / r) * (quad)0.5;
    r = (r + x / r) * (quad)0.5;
    return r * back;
}

static inline bool exact_product_d(double a, double b) {
    return a == 0 || b == 0 || a == 1 || b == 1 || a == -1 || b == -1;
}

static inline bool exact_product_q(quad a, quad b) {
    return a == 0 || b == 0 || ((quad)(double)a == a && (quad)(double)b == b);
}

#define BODY "number/interval_body.h"
#include "number/twice.h"

// The nearest double that is not above, and the nearest that is not below.
static inline double double_below(quad x) {
    double near = (double)x;
    return (quad)near <= x ? near : nextafter(near, -INFINITY);
}

static inline double double_above(quad x) {
    double near = (double)x;
    return (quad)near >= x ? near : nextafter(near, INFINITY);
}

// Returns the narrowest interval of doubles that holds a.
static inline struct ivd narrow(struct ivq a) {
    return (struct ivd){double_below(a.lo), double_above(a.hi)};
}

static inline struct ivq widen(struct ivd a) {
    return (struct ivq){a.lo, a.hi};
}
