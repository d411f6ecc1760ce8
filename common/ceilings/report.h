// Prints measured ceilings on standard output.
#ifndef STEPWISE_CEILINGS_REPORT_H
#define STEPWISE_CEILINGS_REPORT_H

#include "measure.h"

// Prints one JSON object (fields: results/README.md). `begin`: timer_ns at the program's start.
void report_json(struct ceilings *all, uint64_t begin);

#endif
