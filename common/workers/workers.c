// Persistent workers that sleep on a condition variable between frames and take tiles from both ends of the
// frame by one atomic counter. Which worker draws a tile differs from frame to frame; its pixels do not.
#include "workers/workers.h"

#include <pthread.h>
#include <sched.h>
#include <stdalign.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "workers/cpus.h"

// How often the caller looks for the last worker's end before it sleeps. To wake takes 35 µs on a virtual CPU.
enum { LOOKS = 200 };

struct worker {
    struct workers *workers;
    void *scratch; // NULL: memory was short
    pthread_t thread;
    int cpu;           // to be pinned to; −1: not known which there are
    int error;         // of pinning
    struct cpus alone; // its CPU
};

struct workers {
    // Hot: every worker writes it. Tiles taken from the front, and above 32 bits those from the end.
    alignas(WORKERS_APART) _Atomic uint64_t taken;
    // Cold: a few times a frame, under the lock.
    alignas(WORKERS_APART) pthread_mutex_t lock;
    pthread_cond_t begin, rest;
    workers_task *task;
    const void *job;
    int tiles;
    int ready;           // workers that have started
    _Atomic int busy;    // workers that have joined the frame and not yet left it
    unsigned long frame; // its number: each worker joins it once
    bool open;           // it may be joined
    bool ending, stated; // that a thread is not pinned
    int count;           // workers, the caller as the first
    size_t scratch_size;
    struct cpus before; // the caller's, between frames
    struct worker worker[];
};

// The next CPU of a set that is not empty, after the last the first.
static int next_cpu(const struct cpus *cpus, int cpu) {
    do
        cpu = (cpu + 1) % cpus_end(cpus);
    while (!CPU_ISSET_S((size_t)cpu, cpus->size, cpus->set));
    return cpu;
}

// The CPUs that this process may use by turns, the caller's own first.
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

// Called by the thread that will use it, after pinning: memory is near the core that touches it first.
static void *scratch_memory(size_t size) {
    size_t whole = (size / WORKERS_APART + 1) * WORKERS_APART;
    void *scratch = aligned_alloc(WORKERS_APART, whole);
    return scratch ? memset(scratch, 0, whole) : NULL;
}

// Takes some tiles and returns how many, from `*first` on; 0: none are left. Fewer towards the end, so that no
// worker waits long for the last. Half of the workers begin at the frame's end: of two, each writes where it
// wrote the frame before, not cache lines that the other's core still holds.
static int take_tiles(struct workers *workers, bool from_end, int *first) {
    uint64_t taken = atomic_load_explicit(&workers->taken, memory_order_relaxed);
    for (;;) {
        int front = (int)(uint32_t)taken, back = (int)(taken >> 32);
        int left = workers->tiles - front - back, some = left / (16 * workers->count);
        some = some < 1 ? 1 : some > 16 ? 16 : some;
        if (left <= 0)
            return 0;
        *first = from_end ? workers->tiles - back - some : front;
        uint64_t more = (uint64_t)some << (from_end ? 32 : 0);
        if (atomic_compare_exchange_weak_explicit(&workers->taken, &taken, taken + more,
                                                  memory_order_relaxed, memory_order_relaxed))
            return some;
    }
}

static void draw_tiles(struct workers *workers, const struct worker *self) {
    if (workers->count == 1) { // an atomic operation would wait for all that was stored
        for (int tile = 0; tile < workers->tiles; tile++)
            workers->task(workers->job, tile, self->scratch);
        return;
    }
    // The lock has published what a tile needs; the counter only has to count.
    bool from_end = (self - workers->worker) % 2;
    int first;
    for (int count; (count = take_tiles(workers, from_end, &first)) > 0;)
        for (int i = 0; i < count; i++)
            workers->task(workers->job, first + i, self->scratch);
}

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
        draw_tiles(workers, self);
        pthread_mutex_lock(&workers->lock);
        if (--workers->busy == 0)
            pthread_cond_signal(&workers->rest);
    }
    pthread_mutex_unlock(&workers->lock);
    free(self->scratch);
    cpus_free(&self->alone);
    return NULL;
}

// Starts all but the caller and waits until they sleep. Fewer than asked for do the whole work.
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
        fprintf(stderr, "workers: %d of %d threads could be had (%s); they do the whole work\n",
                started, wanted, strerror(error));
}

static void state_unpinned(struct workers *workers, int failed, int error) {
    if (failed > 0 && !workers->stated)
        fprintf(stderr, "workers: %d of %d threads cannot be pinned (%s); they go on unpinned\n",
                failed, workers->count, strerror(error));
    workers->stated = workers->stated || failed > 0;
}

struct workers *workers_start(int threads, size_t scratch_size) {
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
            workers_end(workers);
            return NULL;
        }
    return workers;
}

void workers_run(struct workers *workers, workers_task *task, const void *job, int tiles) {
    struct worker *self = &workers->worker[0];
    pthread_mutex_lock(&workers->lock);
    workers->task = task;
    workers->job = job;
    workers->tiles = tiles;
    atomic_store_explicit(&workers->taken, 0, memory_order_relaxed);
    workers->frame++;
    workers->open = true;
    pthread_cond_broadcast(&workers->begin);
    pthread_mutex_unlock(&workers->lock);
    // The caller is pinned for the frame only: afterwards it is its owner's again.
    bool pinned = false;
    if (workers->count > 1 && self->cpu >= 0 && cpus_get(&workers->before) == 0) {
        int error = cpus_pin(&self->alone, self->cpu);
        pinned = error == 0;
        state_unpinned(workers, !pinned, error);
    }
    draw_tiles(workers, self);
    if (pinned)
        cpus_use(&workers->before);
    pthread_mutex_lock(&workers->lock);
    workers->open = false; // who has not woken by now need not
    pthread_mutex_unlock(&workers->lock);
    for (int i = 0; i < LOOKS && workers->busy > 0; i++)
        sched_yield();
    pthread_mutex_lock(&workers->lock);
    while (workers->busy > 0)
        pthread_cond_wait(&workers->rest, &workers->lock);
    pthread_mutex_unlock(&workers->lock);
}

void workers_end(struct workers *workers) {
    if (!workers)
        return;
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
