// Counts FLOPs by the paper's method: the number of calls of each function times its declared cost
// (costs.def). Only the counting build (build/NAME/render-count) counts; in a timing build COUNT and
// ACTIVE compile to nothing. Phases from opt6_wide on declare no FLOPs: a costs.def of zeros names
// the steps whose calls and active lanes `make try` shows.
//
// A line of costs.def has these columns:
//
//     COST(function, part, width, add, mul, fma, div, sqrt, rsqrt, minmax, compare, call) // derivation
//
// function, part  The part `call` is the function's entry. Other parts are branches and loop bodies
//                 that do not run in every call. A cost excludes functions that have lines of their
//                 own. It includes helper functions without a line.
// width           Lanes that the part's instructions work on: LANES, or 1 for scalar code.
// add … compare   Operations per lane: additions and subtractions; multiplications; fused
//                 multiply-adds; divisions; square roots; approximate reciprocals and reciprocal
//                 roots; minima and maxima; comparisons.
// call            Calls of math.h other than sqrt, or their replacements: sin, pow, fabs, fmin,
//                 floor …
//
// FLOPs are counted by two conventions; every number says by which. Comparisons count in neither.
//     machine = add + mul + 2·fma + div + sqrt + rsqrt + minmax. Hardware counters and Intel SDE
//               count these. Operations inside libm are not included.
//     paper   = machine + call: one FLOP for each math.h call (section 2 of the paper).
// COST_MATH declares a function that replaces a math.h call, for example a phase's own exp. In the
// paper's convention its entry is one FLOP and the rest of it none.
#pragma once

#ifdef STEPWISE_COUNT

#include <stdint.h>

#define COST(function, part, ...) COST_##function##_##part,
#define COST_MATH COST
enum {
#include "costs.def"
    FLOPS_PARTS
};
#undef COST
#undef COST_MATH

struct flops_tally {
    uint64_t calls, lanes; // lanes: active ones, summed over calls
};
extern _Thread_local struct flops_tally flops_tally[FLOPS_PARTS];
extern _Thread_local unsigned flops_active;

// Counts one execution of a part of a function, with the lanes that are active now.
#define COUNT(function, part)                                                                      \
    (flops_tally[COST_##function##_##part].calls++,                                                \
     flops_tally[COST_##function##_##part].lanes += flops_active)
// Sets the number of lanes that do useful work from here on. SIMD phases call it wherever that
// number changes.
#define ACTIVE(lanes) (flops_active = (unsigned)(lanes))

#else

#define COUNT(function, part) ((void)0)
#define ACTIVE(lanes) ((void)0)

#endif
