// Kernels of bandwidth: loads, stores and copies through a window of memory.
//
// `loops` blocks of 16 accesses each, one after the other through a window (a power of two of
// bytes) from `offset` on and round again: without an inner loop there is no end of it to
// mispredict. Returns the next offset. Registers as above.
#ifndef STEPWISE_CEILINGS_BANDWIDTH_H
#define STEPWISE_CEILINGS_BANDWIDTH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum motion { LOAD, STORE, COPY, MOTIONS };
extern const char *const MOTION_NAMES[MOTIONS];

struct window {
    char *base;
    ptrdiff_t apart; // from what a copy reads to what it writes
    size_t mask, offset;
};

struct moving {
    enum motion motion;
    int bits;
    void (*run)(long loops, struct window *w, const void *in, void *out);
    const char *needs;
};
enum { KINDS_OF_MOVING = 12, BLOCK = 16 };
extern const struct moving MOVINGS[KINDS_OF_MOVING];

int loop_bytes(const struct moving *m); // of a block

// A place's content: no two words alike, so that a wrong address shows.
uint64_t word_at(size_t index);

// Runs `loops` blocks in a small window of known content and looks at every byte: what was moved,
// from where to where, and that nothing else was touched. `pretend`: blocks that should have been moved;
// `quiet`: without a word on what is wrong.
bool moves_rightly(const struct moving *m, long loops, long pretend, bool quiet);

#endif
