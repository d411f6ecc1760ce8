// Per-thread counters summed over threads. Linked with --wrap=pthread_create, so that every thread
// of a phase is known from its start on, and its counts are kept at its end; the phase itself does
// nothing for it.
#include <errno.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdlib.h>

#include "counting/count.h"

struct watched {
    uint64_t *counters;
    struct watched *next;
};

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct watched *living;
static uint64_t *gone; // counts of threads that have ended
static bool short_of_memory;

struct start {
    void *(*routine)(void *);
    void *argument;
    struct watched watched;
};

static void retire(void *data) {
    struct start *start = data;
    pthread_mutex_lock(&lock);
    struct watched **link = &living;
    while (*link != &start->watched)
        link = &(*link)->next;
    *link = start->watched.next;
    size_t size;
    const uint64_t *own = tally_own(&size);
    if (!gone)
        gone = calloc(size, sizeof *gone);
    if (gone)
        for (size_t i = 0; i < size; i++)
            gone[i] += own[i];
    else
        short_of_memory = true;
    pthread_mutex_unlock(&lock);
    free(start);
}

static void *watched_thread(void *data) {
    struct start *start = data;
    size_t size;
    pthread_mutex_lock(&lock);
    start->watched = (struct watched){tally_own(&size), living};
    living = &start->watched;
    pthread_mutex_unlock(&lock);
    void *result;
    pthread_cleanup_push(retire, start); // pthread_exit and cancellation come here too
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
    int error = __real_pthread_create(thread, attributes, watched_thread, start);
    if (error)
        free(start);
    return error;
}

bool tally_sum(uint64_t *out, size_t size) {
    size_t own_size;
    const uint64_t *own = tally_own(&own_size);
    pthread_mutex_lock(&lock);
    for (size_t i = 0; i < size; i++)
        out[i] = own[i] + (gone ? gone[i] : 0);
    for (const struct watched *w = living; w; w = w->next)
        if (w->counters != own)
            for (size_t i = 0; i < size; i++)
                out[i] += w->counters[i];
    pthread_mutex_unlock(&lock);
    return !short_of_memory;
}
