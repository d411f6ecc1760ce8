// The code of a phase for one width of lanes. A phase that is compiled for several (driver/variant.h) has one for each,
// VARIANT(kernel).
#pragma once

#include "driver/variant.h"
#include "phase.h"
#include "workers/workers.h"

struct group_calls;
struct job; // one frame's work for all workers, in the phase's own form

struct lane_kernel {
    size_t (*scratch_size)(const struct model *model); // bytes of a worker's memory
    int (*tiles)(const struct job *job);               // how many a frame has
    workers_task *tile;                                // of a struct job
    // As phase_distances().
    bool (*distances)(const struct prepared *prepared, size_t count, const double *points,
                      double *distance, int *nearest);
    const struct group_calls *groups; // for a generated kernel (opt9_convex); NULL: none
};

extern const struct lane_kernel lanes8_kernel, lanes16_kernel;
#ifdef __wasm__ // built for 8 alone
#pragma weak lanes16_kernel
#endif

// Returns the widest that this CPU supports.
static inline const struct lane_kernel *lanes_here(void) {
    return variant_here().lanes == 16 ? &lanes16_kernel : &lanes8_kernel;
}
