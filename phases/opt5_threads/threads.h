// Workers that live from phase_prepare to phase_release: the caller and threads − 1 more threads. Each
// is pinned to a core of its own, as long as there are enough. Between frames they sleep.
#ifndef OPT5_THREADS_THREADS_H
#define OPT5_THREADS_THREADS_H

#include <stddef.h>

// Two cache lines. The L2 prefetcher fetches lines in pairs, so that neighbours would share falsely.
enum { WORKERS_APART = 128 };

struct workers;

// Draws one tile of a job; defined in render.c. `scratch` is memory that only this worker uses. The
// workers call it by name, not by a pointer, so that a profile shows who calls whom.
void render_tile(const void *job, int tile, void *scratch);

// Returns the workers, or NULL when memory is short. Each has `scratch_size` bytes of scratch memory,
// zeroed. A worker that cannot be started or pinned is reported on standard error: the others do its
// share, or it runs unpinned.
struct workers *threads_start(int threads, size_t scratch_size);

// Draws the tiles 0 ... tiles − 1, each once, and returns when all are done. A free worker takes the
// next tile, so that tiles of unequal cost keep all cores busy.
void threads_run(struct workers *workers, const void *job, int tiles);

// Ends the threads and frees their memory.
void threads_end(struct workers *workers);

#endif
