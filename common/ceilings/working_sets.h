// Instruction sets and caches of this machine, and the working set that measures each cache.
#pragma once

#include <stdbool.h>
#include <stddef.h>

// Returns whether the CPU has the feature and STEPWISE_ISA_LIMIT does not hide it. True for NULL.
bool cpu_supports(const char *feature);

enum level { L1, L2, L3, MEMORY, LEVELS };
extern const char *const LEVEL_NAMES[LEVELS];

struct working_set {
    size_t cache_bytes;  // of the cache; 0: unknown
    size_t bytes;        // of the working set; 0: this level is not measured
    const char *missing; // why it is not measured
    const char *rule;    // how `bytes` is chosen
};

// Chooses a working set for each level, a power of two rounded down. L1 and L2: half of the cache.
// L3: the geometric mean of L2 and L3, because L3 is shared and a virtual machine sees the size of
// the whole socket's. Memory: four times L3, at most 512 MiB and a quarter of the machine's memory.
void choose_working_sets(struct working_set working_sets[LEVELS]);
