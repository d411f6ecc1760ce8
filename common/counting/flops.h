// FLOPs by the paper's method: calls of each function times its declared cost
// (phases/NAME/costs.def). In a timing build all of this vanishes; the counting build is
// build/NAME/render-count.
//
// A line of costs.def, in the order of the columns:
//
//     COST(function, part, width, add, mul, fma, div, sqrt, rsqrt, minmax, compare, call) // derivation
//
// function, part  `call` is the entry of a function; other parts are branches and loop bodies of it
//                 that do not run at every call. Costs are the function's own, without those of
//                 functions that have lines of their own; a helper without a line belongs to its
//                 callers.
// width           lanes that the part's instructions work on: LANES, or 1 where it is scalar
// add … compare   operations per lane: sums and differences; products; fused multiply-adds;
//                 quotients; square roots; approximate reciprocals and their roots; minima and
//                 maxima; comparisons
// call            calls of math.h other than sqrt, or what stands in their place: sin, pow, fabs,
//                 fmin, floor …
//
// Two conventions, named wherever a figure stands; comparisons count in neither:
//     machine = add + mul + 2·fma + div + sqrt + rsqrt + minmax: what hardware and SDE count.
//               libm's inside apart.
//     paper   = the same + call: one FLOP for each math.h call (section 2 of the paper).
// COST_MATH declares a function that stands for a math.h call itself (a phase's own exp): in the
// paper's convention its entry is one FLOP, whatever is inside.
#ifndef STEPWISE_FLOPS_H
#define STEPWISE_FLOPS_H

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

// The part is executed once, with the lanes that are active now.
#define COUNT(function, part)                                                                      \
    (flops_tally[COST_##function##_##part].calls++,                                                \
     flops_tally[COST_##function##_##part].lanes += flops_active)
// SIMD phases say, wherever it changes, how many lanes do useful work from here on.
#define ACTIVE(lanes) (flops_active = (unsigned)(lanes))

#else

#define COUNT(function, part) ((void)0)
#define ACTIVE(lanes) ((void)0)

#endif
#endif
