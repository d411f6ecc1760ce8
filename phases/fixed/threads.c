// Persistent workers that sleep on a condition variable between frames and take tiles from one atomic counter.
// Which worker renders a tile varies from frame to frame; the tile's pixels do not.
#include "threads.h"

#include <pthread.h>
#include <sched.h>
#include <stdalign.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct worker {
    struct team *team;
    void *scratch; // NULL: memory was short
    pthread_t thread;
    int cpu;   // to pin to; −1: the CPUs are not known
    int error; // of pinning
};

struct team {
    // Written by every worker at every tile.
    alignas(APART) atomic_int next;
    // Written a few times a frame, under the lock.
    alignas(APART) pthread_mutex_t lock;
    pthread_cond_t begin, rest;
    const void *job;
    int tiles;
    int ready;             // workers that have started
    int busy;              // workers that have joined the frame and not yet left it
    unsigned long frame;   // its number: each worker joins it once
    bool open;             // it may be joined
    bool ending, reported; // reported: that a thread is not pinned
    int count;             // workers, the caller as the first
    size_t scratch_size;
    struct worker worker[];
};

static int pin(int cpu) {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(cpu, &one);
    return pthread_setaffinity_np(pthread_self(), sizeof one, &one);
}

// Assigns the CPUs that this process may use in turn, beginning with the caller's.
static void assign_cpus(struct team *team) {
    cpu_set_t allowed;
    int cpus[CPU_SETSIZE], count = 0, first = 0, here = sched_getcpu();
    int error = pthread_getaffinity_np(pthread_self(), sizeof allowed, &allowed);
    for (int cpu = 0; cpu < CPU_SETSIZE && !error; cpu++)
        if (CPU_ISSET(cpu, &allowed)) {
            first = cpu == here ? count : first;
            cpus[count++] = cpu;
        }
    for (int i = 0; i < team->count; i++) {
        team->worker[i].cpu = error ? -1 : cpus[(first + i) % count];
        team->worker[i].error = error;
    }
}

// Called by the thread that will use the memory, once it is pinned: pages lie near the core that first touches them.
static void *scratch_memory(size_t size) {
    size_t whole = (size / APART + 1) * APART;
    void *scratch = aligned_alloc(APART, whole);
    return scratch ? memset(scratch, 0, whole) : NULL;
}

static void take_tiles(struct team *team, void *scratch) {
    // The lock has published the job, so the counter needs no memory order.
    for (int tile;
         (tile = atomic_fetch_add_explicit(&team->next, 1, memory_order_relaxed)) < team->tiles;)
        render_tile(team->job, tile, scratch);
}

static void *run_worker(void *argument) {
    struct worker *self = argument;
    struct team *team = self->team;
    if (self->cpu >= 0)
        self->error = pin(self->cpu);
    self->scratch = scratch_memory(team->scratch_size);
    pthread_mutex_lock(&team->lock);
    team->ready++;
    pthread_cond_signal(&team->rest);
    for (unsigned long seen = 0;;) {
        while (!team->ending && (!team->open || team->frame == seen))
            pthread_cond_wait(&team->begin, &team->lock);
        if (team->ending)
            break;
        seen = team->frame;
        team->busy++;
        pthread_mutex_unlock(&team->lock);
        take_tiles(team, self->scratch);
        pthread_mutex_lock(&team->lock);
        if (--team->busy == 0)
            pthread_cond_signal(&team->rest);
    }
    pthread_mutex_unlock(&team->lock);
    free(self->scratch);
    return NULL;
}

// Starts all workers but the caller and waits until they sleep. If some cannot be started, the others do their share.
static void start_workers(struct team *team) {
    int wanted = team->count, started = 1, error = 0;
    for (; started < wanted && !error; started += !error)
        error =
            pthread_create(&team->worker[started].thread, NULL, run_worker, &team->worker[started]);
    pthread_mutex_lock(&team->lock);
    team->count = started;
    while (team->ready < started - 1)
        pthread_cond_wait(&team->rest, &team->lock);
    pthread_mutex_unlock(&team->lock);
    if (error)
        fprintf(stderr, "fixed: %d of %d threads could be had (%s); they do the whole work\n",
                started, wanted, strerror(error));
}

static void report_unpinned(struct team *team, int failed, int error) {
    if (failed > 0 && !team->reported)
        fprintf(stderr, "fixed: %d of %d threads cannot be pinned (%s); they go on unpinned\n",
                failed, team->count, strerror(error));
    team->reported = team->reported || failed > 0;
}

struct team *team_start(int threads, size_t scratch_size) {
    size_t size = sizeof(struct team) + (size_t)threads * sizeof(struct worker);
    struct team *team = aligned_alloc(APART, (size + APART - 1) / APART * APART);
    if (!team)
        return NULL;
    memset(team, 0, size);
    pthread_mutex_init(&team->lock, NULL); // these three cannot fail here: glibc's never do
    pthread_cond_init(&team->begin, NULL);
    pthread_cond_init(&team->rest, NULL);
    team->count = threads;
    team->scratch_size = scratch_size;
    for (int i = 0; i < threads; i++)
        team->worker[i].team = team;
    team->worker[0].scratch = scratch_memory(scratch_size);
    if (threads > 1) {
        assign_cpus(team);
        start_workers(team);
    }
    int failed = 0, error = 0;
    for (int i = 1; i < team->count; i++)
        if (team->worker[i].error) {
            failed++;
            error = team->worker[i].error;
        }
    report_unpinned(team, failed, error);
    for (int i = 0; i < team->count; i++)
        if (!team->worker[i].scratch) {
            team_end(team);
            return NULL;
        }
    return team;
}

void team_run(struct team *team, const void *job, int tiles) {
    struct worker *self = &team->worker[0];
    pthread_mutex_lock(&team->lock);
    team->job = job;
    team->tiles = tiles;
    atomic_store_explicit(&team->next, 0, memory_order_relaxed);
    team->frame++;
    team->open = true;
    pthread_cond_broadcast(&team->begin);
    pthread_mutex_unlock(&team->lock);
    // The caller is pinned for the frame only.
    cpu_set_t before;
    bool pinned = false;
    if (team->count > 1 && self->cpu >= 0 &&
        pthread_getaffinity_np(pthread_self(), sizeof before, &before) == 0) {
        int error = pin(self->cpu);
        pinned = error == 0;
        report_unpinned(team, !pinned, error);
    }
    take_tiles(team, self->scratch);
    if (pinned)
        pthread_setaffinity_np(pthread_self(), sizeof before, &before);
    pthread_mutex_lock(&team->lock);
    team->open = false; // a worker that has not woken need not join
    while (team->busy > 0)
        pthread_cond_wait(&team->rest, &team->lock);
    pthread_mutex_unlock(&team->lock);
}

void team_end(struct team *team) {
    pthread_mutex_lock(&team->lock);
    team->ending = true;
    pthread_cond_broadcast(&team->begin);
    pthread_mutex_unlock(&team->lock);
    for (int i = 1; i < team->count; i++)
        pthread_join(team->worker[i].thread, NULL);
    free(team->worker[0].scratch);
    pthread_cond_destroy(&team->rest);
    pthread_cond_destroy(&team->begin);
    pthread_mutex_destroy(&team->lock);
    free(team);
}
