// A pool of worker threads that lives from phase_prepare to phase_release: the caller and threads − 1 more, each
// pinned to a core of its own while there are enough, asleep between frames.
#ifndef FIXED_THREADS_H
#define FIXED_THREADS_H

#include <stddef.h>

// Two cache lines: the prefetcher of L2 fetches pairs of lines, so that neighbours would be shared falsely.
enum { APART = 128 };

struct team;

// Renders one tile of a job; defined in render.c. `scratch` is the worker's own memory. Called by its name and
// not by a pointer, so that a profile shows who calls it.
void render_tile(const void *job, int tile, void *scratch);

// Starts the workers, each with scratch_size bytes of memory of its own. Returns NULL when memory is short.
// If a worker cannot be started, the others do its share; if one cannot be pinned, it runs unpinned. Both are reported
// on standard error.
struct team *team_start(int threads, size_t scratch_size);

// Renders tiles 0 … tiles − 1, each once, by whichever worker is free. Returns when all are done.
void team_run(struct team *team, const void *job, int tiles);

// Ends the workers and frees their memory.
void team_end(struct team *team);

#endif
