// Tests all kernels (--check). Each must pass its check, and the check must fail after one loop too
// many and from other operands: a check that cannot fail proves nothing.
#ifndef STEPWISE_CEILINGS_CHECK_H
#define STEPWISE_CEILINGS_CHECK_H

#include "measure.h"

// Prints the number of kernels tested and every fault. Returns OK or WRONG_WORK.
enum status self_test(void);

#endif
