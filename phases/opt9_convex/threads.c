// Persistent workers that sleep on a condition variable between frames and draw tiles from one
// atomic counter, of both ends. Which worker draws which tile differs from frame to frame; what is in it does not.
#include "threads.h"

#include <pthread.h>
#include <sched.h>
#include <stdalign.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct worker {
    struct team *team;
    void *own; // NULL: memory was short
    pthread_t thread;
    int cpu;   // to be pinned to; −1: not known which there are
    int error; // of pinning
};

struct team {
    // Hot: everyone writes it at every tile. How many were taken from the front, and above 32 bits from the end.
    alignas(APART) _Atomic uint64_t taken;
    // Cold: a few times a frame, under the lock.
    alignas(APART) pthread_mutex_t lock;
    pthread_cond_t begin, rest;
    const void *job;
    int tiles;
    int ready;           // workers that have started
    int busy;            // workers that have joined the frame and not yet left it
    unsigned long frame; // its number: each worker joins it once
    bool open;           // it may be joined
    bool ending, stated; // that a thread is not pinned
    int count;           // workers, the caller as the first
    size_t own_size;
    struct worker worker[];
};

static int pin(int cpu) {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(cpu, &one);
    return pthread_setaffinity_np(pthread_self(), sizeof one, &one);
}

// The CPUs that this process may use by turns, the caller's own first.
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

// By the thread that will use it, once it is where it stays: memory is near the core that touches
// it first.
static void *own_memory(size_t size) {
    size_t whole = (size / APART + 1) * APART;
    void *own = aligned_alloc(APART, whole);
    return own ? memset(own, 0, whole) : NULL;
}

// Some at a time, fewer towards the end, so that no worker waits long for the last. Half of the workers begin at the
// picture's end: of two, each writes where it wrote the frame before, and not lines that the other's cache still has
// (scene0: 4.68 -> 4.38 ms). How many there are; 0: none are left.
static int take_tiles(struct team *team, bool from_end, int *first) {
    uint64_t taken = atomic_load_explicit(&team->taken, memory_order_relaxed);
    for (;;) {
        int front = (int)(uint32_t)taken, back = (int)(taken >> 32);
        int left = team->tiles - front - back, some = left / (16 * team->count);
        some = some < 1 ? 1 : some > 16 ? 16 : some;
        if (left <= 0)
            return 0;
        *first = from_end ? team->tiles - back - some : front;
        uint64_t more = (uint64_t)some << (from_end ? 32 : 0);
        if (atomic_compare_exchange_weak_explicit(&team->taken, &taken, taken + more,
                                                  memory_order_relaxed, memory_order_relaxed))
            return some;
    }
}

static void draw_tiles(struct team *team, const struct worker *self) {
    if (team->count == 1) { // an atomic operation would wait for all that was stored
        for (int tile = 0; tile < team->tiles; tile++)
            render_tile(team->job, tile, self->own);
        return;
    }
    // The lock has published what a tile needs; the counter only has to count.
    bool from_end = (self - team->worker) % 2;
    int first;
    for (int count; (count = take_tiles(team, from_end, &first)) > 0;)
        for (int i = 0; i < count; i++)
            render_tile(team->job, first + i, self->own);
}

static void *live(void *argument) {
    struct worker *self = argument;
    struct team *team = self->team;
    if (self->cpu >= 0)
        self->error = pin(self->cpu);
    self->own = own_memory(team->own_size);
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
        draw_tiles(team, self);
        pthread_mutex_lock(&team->lock);
        if (--team->busy == 0)
            pthread_cond_signal(&team->rest);
    }
    pthread_mutex_unlock(&team->lock);
    free(self->own);
    return NULL;
}

// Starts all but the caller and waits until they sleep. Fewer than asked for do the whole work.
static void start_workers(struct team *team) {
    int wanted = team->count, started = 1, error = 0;
    for (; started < wanted && !error; started += !error)
        error = pthread_create(&team->worker[started].thread, NULL, live, &team->worker[started]);
    pthread_mutex_lock(&team->lock);
    team->count = started;
    while (team->ready < started - 1)
        pthread_cond_wait(&team->rest, &team->lock);
    pthread_mutex_unlock(&team->lock);
    if (error)
        fprintf(stderr, "opt9_convex: %d of %d threads could be had (%s); they do the whole work\n",
                started, wanted, strerror(error));
}

static void state_unpinned(struct team *team, int failed, int error) {
    if (failed > 0 && !team->stated)
        fprintf(stderr,
                "opt9_convex: %d of %d threads cannot be pinned (%s); they go on unpinned\n",
                failed, team->count, strerror(error));
    team->stated = team->stated || failed > 0;
}

struct team *team_start(int threads, size_t own_size) {
    size_t size = sizeof(struct team) + (size_t)threads * sizeof(struct worker);
    struct team *team = aligned_alloc(APART, (size + APART - 1) / APART * APART);
    if (!team)
        return NULL;
    memset(team, 0, size);
    pthread_mutex_init(&team->lock, NULL); // these three cannot fail here: glibc's never do
    pthread_cond_init(&team->begin, NULL);
    pthread_cond_init(&team->rest, NULL);
    team->count = threads;
    team->own_size = own_size;
    for (int i = 0; i < threads; i++)
        team->worker[i].team = team;
    team->worker[0].own = own_memory(own_size);
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
    state_unpinned(team, failed, error);
    for (int i = 0; i < team->count; i++)
        if (!team->worker[i].own) {
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
    atomic_store_explicit(&team->taken, 0, memory_order_relaxed);
    team->frame++;
    team->open = true;
    pthread_cond_broadcast(&team->begin);
    pthread_mutex_unlock(&team->lock);
    // The caller is pinned for the frame only: afterwards it is its owner's again.
    cpu_set_t before;
    bool pinned = false;
    if (team->count > 1 && self->cpu >= 0 &&
        pthread_getaffinity_np(pthread_self(), sizeof before, &before) == 0) {
        int error = pin(self->cpu);
        pinned = error == 0;
        state_unpinned(team, !pinned, error);
    }
    draw_tiles(team, self);
    if (pinned)
        pthread_setaffinity_np(pthread_self(), sizeof before, &before);
    pthread_mutex_lock(&team->lock);
    team->open = false; // who has not woken by now need not
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
    free(team->worker[0].own);
    pthread_cond_destroy(&team->rest);
    pthread_cond_destroy(&team->begin);
    pthread_mutex_destroy(&team->lock);
    free(team);
}
