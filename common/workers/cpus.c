// Sets of CPUs that grow until the kernel accepts them (sched_getaffinity(2), "Handling systems with large
// CPU affinity masks").
#include "workers/cpus.h"

#include <errno.h>
#include <pthread.h>
#include <stdbool.h>

enum { MOST = 1 << 20 }; // CPUs; the kernel has at most 8,192 today

static bool make_room(struct cpus *cpus, int count) {
    if (cpus->set && cpus->size >= CPU_ALLOC_SIZE(count))
        return true;
    cpus_free(cpus);
    cpus->set = CPU_ALLOC(count);
    cpus->size = cpus->set ? CPU_ALLOC_SIZE(count) : 0;
    return cpus->set;
}

int cpus_get(struct cpus *cpus) {
    int error = EINVAL, count = cpus->set ? cpus_end(cpus) : CPU_SETSIZE;
    for (; error == EINVAL && count <= MOST; count *= 2) {
        if (!make_room(cpus, count))
            return ENOMEM;
        CPU_ZERO_S(cpus->size, cpus->set);
        error = pthread_getaffinity_np(pthread_self(), cpus->size, cpus->set);
    }
    return error;
}

int cpus_use(const struct cpus *cpus) {
    return pthread_setaffinity_np(pthread_self(), cpus->size, cpus->set);
}

int cpus_pin(struct cpus *room, int cpu) {
    if (!make_room(room, cpu + 1))
        return ENOMEM;
    CPU_ZERO_S(room->size, room->set);
    CPU_SET_S((size_t)cpu, room->size, room->set);
    return cpus_use(room);
}

int cpus_end(const struct cpus *cpus) {
    return (int)(8 * cpus->size);
}

void cpus_free(struct cpus *cpus) {
    CPU_FREE(cpus->set);
    *cpus = (struct cpus){0};
}
