// Counts executions of each basic block of the phase, for build/NAME/render-blocks. The phase's own
// code raises the counters: scripts/study/counting/assembly.py inserts the instructions. table.json beside
// the program says which block each counter belongs to.
#include <stdlib.h>

#include "blocks_table.h"
#include "counting/count.h"

enum { COUNTERS = BLOCKS + MASKED + REPEATED };

// The inserted instructions refer to both by name; they save rax and rcx in stepwise_saved.
extern _Thread_local uint64_t stepwise_counters[COUNTERS];
extern _Thread_local uint64_t stepwise_saved[2];
_Thread_local uint64_t stepwise_counters[COUNTERS];
_Thread_local uint64_t stepwise_saved[2];

uint64_t *tally_own(size_t *size) {
    *size = COUNTERS;
    return stepwise_counters;
}

static json_t *numbers(const uint64_t *from, size_t size) {
    json_t *array = json_array();
    for (size_t i = 0; array && i < size; i++)
        if (json_array_append_new(array, json_integer((json_int_t)from[i])) != 0) {
            json_decref(array);
            return NULL;
        }
    return array;
}

json_t *count_result(void) {
    const uint64_t *counted = tally_counted();
    if (!counted)
        return NULL;
    // If any object is NULL, json_pack releases the others and returns NULL.
    return json_pack("{s:s, s:s, s:o, s:o, s:o}", "counts", "basic blocks", "table", TABLE_HASH,
                     "blocks", numbers(counted, BLOCKS), "masked",
                     numbers(counted + BLOCKS, MASKED), "repeated",
                     numbers(counted + BLOCKS + MASKED, REPEATED));
}
