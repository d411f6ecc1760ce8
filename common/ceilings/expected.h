// What a kernel of arithmetic must have done: the same operations, one by one, in C.
#ifndef STEPWISE_CEILINGS_EXPECTED_H
#define STEPWISE_CEILINGS_EXPECTED_H

#include "arithmetic.h"

// The operands a kernel starts from.
void start(const struct compute *c, union registers *r);

// The registers as `loops` of the body must leave them.
void expect(const struct compute *c, long loops, const union registers *in, union registers *out);

// Whether they are so; `quiet`: without a word on what is not. NaN is wrong. Approximations are judged
// by their documented error; everything else must be right bit for bit.
bool work_done(const struct compute *c, const union registers *found, const union registers *wanted,
               bool quiet);

#endif
