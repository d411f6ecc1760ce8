// Sums per-thread counters over all threads. The program is linked with --wrap=pthread_create, so
// that each thread registers its counters when it starts and adds them to a total when it ends. The
// phase needs no code for this.
#include <errno.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdlib.h>

#include "counting/count.h"

struct thread_counters {
    uint64_t *counters;
    struct thread_counters *next;
};

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct thread_counters *running;
static uint64_t *ended; // sums of the threads that have ended
static uint64_t *sums;  // what the region has counted
static bool short_of_memory;

struct start {
    void *(*routine)(void *);
    void *argument;
    struct thread_counters thread_counters;
};

// Adds a thread's counters to `ended` and forgets the thread.
static void retire(void *data) {
    struct start *start = data;
    pthread_mutex_lock(&lock);
    struct thread_counters **link = &running;
    while (*link != &start->thread_counters)
        link = &(*link)->next;
    *link = start->thread_counters.next;
    size_t size;
    const uint64_t *own = tally_own(&size);
    if (!ended)
        ended = calloc(size, sizeof *ended);
    if (ended)
        for (size_t i = 0; i < size; i++)
            ended[i] += own[i];
    else
        short_of_memory = true;
    pthread_mutex_unlock(&lock);
    free(start);
}

static void *counted_thread(void *data) {
    struct start *start = data;
    size_t size;
    pthread_mutex_lock(&lock);
    start->thread_counters = (struct thread_counters){tally_own(&size), running};
    running = &start->thread_counters;
    pthread_mutex_unlock(&lock);
    void *result;
    pthread_cleanup_push(retire, start); // also runs on pthread_exit and cancellation
    result = start->routine(start->argument);
    pthread_cleanup_pop(1);
    return result;
}

int __real_pthread_create(pthread_t *thread, const pthread_attr_t *attributes,
                          void *(*routine)(void *), void *argument);
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes,
                          void *(*routine)(void *), void *argument);
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes,
                          void *(*routine)(void *), void *argument) {
    struct start *start = malloc(sizeof *start);
    if (!start)
        return EAGAIN;
    *start = (struct start){.routine = routine, .argument = argument};
    int error = __real_pthread_create(thread, attributes, counted_thread, start);
    if (error)
        free(start);
    return error;
}

// Adds the counters of all threads to sums[], times 1 or −1. The other threads must be idle.
static void add_all(uint64_t times) {
    size_t size;
    const uint64_t *own = tally_own(&size);
    pthread_mutex_lock(&lock);
    if (!sums)
        sums = calloc(size, sizeof *sums);
    short_of_memory = short_of_memory || !sums;
    for (size_t i = 0; sums && i < size; i++)
        sums[i] += times * (own[i] + (ended ? ended[i] : 0));
    for (const struct thread_counters *w = running; w; w = w->next)
        for (size_t i = 0; sums && w->counters != own && i < size; i++)
            sums[i] += times * w->counters[i];
    pthread_mutex_unlock(&lock);
}

void count_begin(void) {
    add_all(-UINT64_C(1));
}

void count_end(void) {
    add_all(1);
}

const uint64_t *tally_counted(void) {
    return short_of_memory ? NULL : sums;
}
