// The results that an arithmetic kernel must have: the same operations, one by one, in C.
#pragma once

#include "arithmetic.h"

// Sets the registers to the operands that a kernel starts from.
void initial_registers(const struct arithmetic_kernel *c, union registers *r);

// Computes the registers after `loops` executions of the body.
void reference_result(const struct arithmetic_kernel *c, long loops, const union registers *in,
                      union registers *out);

// Returns whether the registers `found` are right. Results of approximate instructions may differ by
// their documented error; all others must be equal bit for bit. NaN is wrong. Prints the first
// difference on standard error, unless `quiet`.
bool matches_reference(const struct arithmetic_kernel *c, const union registers *found,
                       const union registers *wanted, bool quiet);
