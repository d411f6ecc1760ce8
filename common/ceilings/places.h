// What this machine has: instruction sets, caches, and the working sets that measure each of them.
#ifndef STEPWISE_CEILINGS_PLACES_H
#define STEPWISE_CEILINGS_PLACES_H

#include <stdbool.h>
#include <stddef.h>

// Whether the CPU has it (NULL: nothing), as far as STEPWISE_ISA_LIMIT lets it.
bool has(const char *feature);

enum level { L1, L2, L3, MEMORY, LEVELS };
extern const char *const LEVEL_NAMES[LEVELS];

struct place {
    size_t cache, working_set; // bytes; working_set 0: left out, `why`
    const char *why, *rule;
};

// Half of L1 and of L2. L3 is shared, and a virtual machine is told the size of the whole socket's,
// of which it has no claim to half: the geometric mean of L2 and L3 is far above the one and far
// below the other. Memory: four times L3, but at most 512 MiB and a quarter of what there is.
// Powers of two, downwards.
void find_places(struct place places[LEVELS]);

#endif
