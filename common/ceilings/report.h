// Prints measured ceilings on standard output.
#pragma once

#include "measure.h"

// Prints one JSON object (fields: results/README.md). `begin`: timer_ns at the program's start.
void report_json(struct ceilings *all, uint64_t begin);
