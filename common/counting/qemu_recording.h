// What the QEMU plugin counts, and the file that it writes at the end. The plugin has one instance
// per process, so that its state is global.
#ifndef STEPWISE_COUNTING_QEMU_RECORDING_H
#define STEPWISE_COUNTING_QEMU_RECORDING_H

#include <stdbool.h>
#include <stdint.h>

#include "counting/qemu_api.h"

// A translated block. QEMU can drop a block and translate it again; blocks with the same bytes at the
// same address share one structure.
struct block {
    struct block *next;
    uint64_t address;
    uint64_t count;  // executions
    uint64_t before; // count when the region was entered
    uint64_t sum;    // executions within the region
    size_t size, instructions;
    unsigned char bytes[];
};

// A repeated string instruction (rep movs …) of a block, with the bytes that it loads and stores.
// The block's count does not give the number of its repetitions.
struct repeated {
    struct repeated *next;
    const struct block *block;
    uint64_t address, loaded, stored;
};

// A conditional jump, whose taken executions are counted.
struct jump {
    struct jump *next;
    uint64_t jump, target, fallthrough; // addresses in the ELF file
    uint64_t taken;
};

struct recording {
    const char *out;          // path of the file to write
    uint64_t code;            // address of the first executable segment in the ELF file
    uint64_t bias;            // address in memory − address in the ELF file
    int api;                  // version of QEMU's plugin API
    bool inside;              // in the region now
    uint64_t regions;         // how often the region was left
    const char *trouble;      // the first problem, one word; NULL: none
    struct jump *jumps;       // list
    struct repeated *strings; // list
};
extern struct recording recording;

// Records a problem. Only the first one is kept.
void recording_fail(const char *problem);

// Returns the block that was translated, a new one if its bytes at its address are new. NULL: memory
// is short.
struct block *recording_block(const struct qemu_plugin_tb *tb);

// Returns the repeated instruction at `address` of a block. NULL: memory is short.
struct repeated *recording_repeated(const struct block *block, uint64_t address);

// Enters the region before the first instruction of `current`, or leaves it there. The block has
// already been counted then; that execution belongs to what follows.
void recording_enter(const struct block *current);
void recording_leave(const struct block *current);

// Writes the recording. scripts/study/counting/qemu_recording.py reads it.
void recording_write(void);

#endif
