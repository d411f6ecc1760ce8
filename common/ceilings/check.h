// --check: every kernel does its work, and does not when it ran once less or from another start: a
// check that cannot fail checks nothing.
#ifndef STEPWISE_CEILINGS_CHECK_H
#define STEPWISE_CEILINGS_CHECK_H

#include "measure.h"

// Says how many kernels were checked, and what is wrong.
enum status check(void);

#endif
