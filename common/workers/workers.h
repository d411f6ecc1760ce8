// A team of workers that stays from phase_prepare to phase_release: the caller and threads − 1 more, each
// pinned to a core of its own as long as there are enough, asleep between frames. opt5_threads teaches how.
#pragma once

#include <stddef.h>

// Two cache lines: L2's prefetcher fetches them in pairs, and neighbours would share falsely.
enum { WORKERS_APART = 128 };

struct workers;

// Draws one tile of a job. `scratch` is this worker's memory and nobody else's.
typedef void workers_task(const void *job, int tile, void *scratch);

// Each worker gets `scratch_size` bytes of its own, zeroed. NULL when memory is short. A worker that cannot
// be started or pinned is reported on standard error; the others do its share, or it runs unpinned.
struct workers *workers_start(int threads, size_t scratch_size);

// Calls the task for the tiles 0 … tiles − 1, each once, by whoever is free; returns when all are done.
void workers_run(struct workers *workers, workers_task *task, const void *job, int tiles);

// NULL: nothing to end.
void workers_end(struct workers *workers);
