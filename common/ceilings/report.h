// Measured ceilings on standard output.
#ifndef STEPWISE_CEILINGS_REPORT_H
#define STEPWISE_CEILINGS_REPORT_H

#include "measure.h"

// One JSON object (results/README.md). `begin`: when the program began, by timer_ns.
void report_json(struct ceilings *all, uint64_t begin);

// A line for each.
void report_table(struct ceilings *all, int samples);

#endif
