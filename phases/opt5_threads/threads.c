// Persistent workers: they sleep on a condition variable between frames and take tiles from one atomic
// counter. Which worker draws a tile differs from frame to frame; its pixels do not.
#include "threads.h"

#include <pthread.h>
#include <sched.h>
#include <stdalign.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "workers/cpus.h"

struct worker {
    struct workers *workers;
    void *scratch; // NULL: memory was short
    pthread_t thread;
    int cpu;           // the CPU to pin it to; −1: the CPUs are unknown
    int error;         // from pinning, 0: pinned
    struct cpus alone; // the set of that CPU
};

struct workers {
    // Hot: every worker writes it at every tile.
    alignas(WORKERS_APART) atomic_int next;
    // Cold: written a few times a frame, under the lock.
    alignas(WORKERS_APART) pthread_mutex_t lock;
    pthread_cond_t begin, rest;
    const void *job;
    int tiles;
    int ready;           // workers that have started
    int busy;            // workers that have joined the frame and not yet left it
    unsigned long frame; // its number: each worker joins it once
    bool open;           // workers may join the frame
    bool ending;         // workers shall end
    bool stated;         // an unpinned thread has been reported
    int count;           // workers, the caller is the first
    size_t scratch_size;
    struct cpus before; // the caller's CPUs, which it gets back after each frame
    struct worker worker[];
};

// The next CPU of a set that is not empty, after the last the first.
static int next_cpu(const struct cpus *cpus, int cpu) {
    do
        cpu = (cpu + 1) % cpus_end(cpus);
    while (!CPU_ISSET_S((size_t)cpu, cpus->size, cpus->set));
    return cpu;
}

// Assigns the CPUs that this process may use to the workers in turn, the caller's own CPU first.
static void assign_cpus(struct workers *workers) {
    const struct cpus *allowed = &workers->before;
    int error = cpus_get(&workers->before), cpu = sched_getcpu();
    if (!error && (cpu < 0 || !CPU_ISSET_S((size_t)cpu, allowed->size, allowed->set)))
        cpu = next_cpu(allowed, -1);
    for (int i = 0; i < workers->count; i++) {
        workers->worker[i].cpu = error ? -1 : cpu;
        workers->worker[i].error = error;
        cpu = error ? cpu : next_cpu(allowed, cpu);
    }
}

// Called by the thread that will use the memory, after pinning: Linux places a page near the core that
// touches it first.
static void *scratch_memory(size_t size) {
    size_t whole = (size / WORKERS_APART + 1) * WORKERS_APART;
    void *scratch = aligned_alloc(WORKERS_APART, whole);
    return scratch ? memset(scratch, 0, whole) : NULL;
}

static void draw_tiles(struct workers *workers, void *scratch) {
    // The lock has published the job, so the counter needs no memory order.
    for (int tile; (tile = atomic_fetch_add_explicit(&workers->next, 1, memory_order_relaxed)) <
                   workers->tiles;)
        render_tile(workers->job, tile, scratch);
}

// A worker's thread: waits for a frame, draws tiles, and waits again.
static void *live(void *argument) {
    struct worker *self = argument;
    struct workers *workers = self->workers;
    if (self->cpu >= 0)
        self->error = cpus_pin(&self->alone, self->cpu);
    self->scratch = scratch_memory(workers->scratch_size);
    pthread_mutex_lock(&workers->lock);
    workers->ready++;
    pthread_cond_signal(&workers->rest);
    for (unsigned long seen = 0;;) {
        while (!workers->ending && (!workers->open || workers->frame == seen))
            pthread_cond_wait(&workers->begin, &workers->lock);
        if (workers->ending)
            break;
        seen = workers->frame;
        workers->busy++;
        pthread_mutex_unlock(&workers->lock);
        draw_tiles(workers, self->scratch);
        pthread_mutex_lock(&workers->lock);
        if (--workers->busy == 0)
            pthread_cond_signal(&workers->rest);
    }
    pthread_mutex_unlock(&workers->lock);
    free(self->scratch);
    cpus_free(&self->alone);
    return NULL;
}

// Starts all workers but the caller and waits until they sleep. If fewer threads start than requested,
// these do the whole work.
static void start_workers(struct workers *workers) {
    int wanted = workers->count, started = 1, error = 0;
    for (; started < wanted && !error; started += !error)
        error =
            pthread_create(&workers->worker[started].thread, NULL, live, &workers->worker[started]);
    pthread_mutex_lock(&workers->lock);
    workers->count = started;
    while (workers->ready < started - 1)
        pthread_cond_wait(&workers->rest, &workers->lock);
    pthread_mutex_unlock(&workers->lock);
    if (error)
        fprintf(stderr,
                "opt5_threads: %d of %d threads could be had (%s); they do the whole work\n",
                started, wanted, strerror(error));
}

static void state_unpinned(struct workers *workers, int failed, int error) {
    if (failed > 0 && !workers->stated)
        fprintf(stderr,
                "opt5_threads: %d of %d threads cannot be pinned (%s); they go on unpinned\n",
                failed, workers->count, strerror(error));
    workers->stated = workers->stated || failed > 0;
}

struct workers *threads_start(int threads, size_t scratch_size) {
    size_t size = sizeof(struct workers) + (size_t)threads * sizeof(struct worker);
    struct workers *workers =
        aligned_alloc(WORKERS_APART, (size + WORKERS_APART - 1) / WORKERS_APART * WORKERS_APART);
    if (!workers)
        return NULL;
    memset(workers, 0, size);
    pthread_mutex_init(&workers->lock, NULL); // these three cannot fail here: glibc's never do
    pthread_cond_init(&workers->begin, NULL);
    pthread_cond_init(&workers->rest, NULL);
    workers->count = threads;
    workers->scratch_size = scratch_size;
    for (int i = 0; i < threads; i++)
        workers->worker[i].workers = workers;
    workers->worker[0].scratch = scratch_memory(scratch_size);
    if (threads > 1) {
        assign_cpus(workers);
        start_workers(workers);
    }
    int failed = 0, error = 0;
    for (int i = 1; i < workers->count; i++)
        if (workers->worker[i].error) {
            failed++;
            error = workers->worker[i].error;
        }
    state_unpinned(workers, failed, error);
    for (int i = 0; i < workers->count; i++)
        if (!workers->worker[i].scratch) {
            threads_end(workers);
            return NULL;
        }
    return workers;
}

void threads_run(struct workers *workers, const void *job, int tiles) {
    struct worker *self = &workers->worker[0];
    pthread_mutex_lock(&workers->lock);
    workers->job = job;
    workers->tiles = tiles;
    atomic_store_explicit(&workers->next, 0, memory_order_relaxed);
    workers->frame++;
    workers->open = true;
    pthread_cond_broadcast(&workers->begin);
    pthread_mutex_unlock(&workers->lock);
    // The caller is pinned for the frame only: its thread belongs to the program.
    bool pinned = false;
    if (workers->count > 1 && self->cpu >= 0 && cpus_get(&workers->before) == 0) {
        int error = cpus_pin(&self->alone, self->cpu);
        pinned = error == 0;
        state_unpinned(workers, !pinned, error);
    }
    draw_tiles(workers, self->scratch);
    if (pinned)
        cpus_use(&workers->before);
    pthread_mutex_lock(&workers->lock);
    workers->open = false; // a worker that has not woken yet need not
    while (workers->busy > 0)
        pthread_cond_wait(&workers->rest, &workers->lock);
    pthread_mutex_unlock(&workers->lock);
}

void threads_end(struct workers *workers) {
    pthread_mutex_lock(&workers->lock);
    workers->ending = true;
    pthread_cond_broadcast(&workers->begin);
    pthread_mutex_unlock(&workers->lock);
    for (int i = 1; i < workers->count; i++)
        pthread_join(workers->worker[i].thread, NULL);
    free(workers->worker[0].scratch);
    cpus_free(&workers->worker[0].alone);
    cpus_free(&workers->before);
    pthread_cond_destroy(&workers->rest);
    pthread_cond_destroy(&workers->begin);
    pthread_mutex_destroy(&workers->lock);
    free(workers);
}
