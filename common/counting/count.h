// Counters of the timed region. A counting build has one of two implementations: flops.c counts calls
// and multiplies them by declared costs, blocks.c counts basic blocks of the assembly. A timing
// build has none.
#pragma once

#include <jansson.h>
#include <stddef.h>
#include <stdint.h>

// Called before and after phase_render, in tally.c. The result is what all threads count in between.
void count_begin(void);
void count_end(void);

// Returns a new JSON object with the counts, NULL if memory is short. The driver merges it into its
// record (fields: results/README.md).
json_t *count_result(void);

// The functions below connect an implementation with tally.c, which sums counters over threads.

// Defined by the implementation. Returns the calling thread's counters and their number, which is
// the same in every thread.
uint64_t *tally_own(size_t *size);

// Defined by tally.c. Returns what the counters of all threads, running and ended, rose by in the region; NULL if counts
// were lost because memory was short.
const uint64_t *tally_counted(void);
