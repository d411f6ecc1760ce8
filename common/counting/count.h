// What the driver asks of a counting build: counts of the timed region alone. Implemented by
// flops.c (calls times declared costs) and by blocks.c (basic blocks of the assembly); a timing
// build has neither.
#ifndef STEPWISE_COUNT_H
#define STEPWISE_COUNT_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Around phase_render: what is counted between the two, by all threads, is the result.
void count_begin(void);
void count_end(void);

// A new object with what was counted, to be merged into the driver's record; NULL when memory is
// short.
json_t *count_result(void);

// The rest is for those who implement it, on top of tally.c, which sums 64-bit counters over
// threads.

// The calling thread's counters, `*size` of them, the same number in every thread.
uint64_t *tally_own(size_t *size);

// Adds up the counters of all threads, living and gone, into out[size]. The others must be idle.
// False when memory was short at any thread's start: then nothing can be said.
bool tally_sum(uint64_t *out, size_t size);

#endif
