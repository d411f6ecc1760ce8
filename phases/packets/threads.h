// A team of workers that stays from phase_prepare to phase_release: the caller and threads − 1 more,
// each on a core of its own as long as there are enough, asleep between frames.
#ifndef PACKETS_THREADS_H
#define PACKETS_THREADS_H

#include <stddef.h>

// Two cache lines: L2's prefetcher fetches them in pairs, which is false sharing once more.
enum { APART = 128 };

struct team;

// render.c's: one tile of a job; `own` is the worker's and nobody else's. Called by its name: what
// counts calls sees who calls whom.
void render_tile(const void *job, int tile, void *own);

// Each worker gets `own_size` bytes of its own. NULL when memory is short. A worker that cannot be
// started or pinned is stated on standard error; the others do its share, or it runs unpinned.
struct team *team_start(int threads, size_t own_size);

// Tiles 0 … tiles − 1, each once, by whoever is free; returns when all are done.
void team_run(struct team *team, const void *job, int tiles);

void team_end(struct team *team);

#endif
