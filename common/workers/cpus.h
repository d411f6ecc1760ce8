// Sets of CPUs of any size: cpu_set_t itself ends at 1,024, and the kernel refuses a set that is smaller than
// its own.
#pragma once

#include <sched.h>
#include <stddef.h>

// {0} is an empty set that has no room yet; cpus_free gives the room back.
struct cpus {
    size_t size; // bytes
    cpu_set_t *set;
};

// The CPUs that the calling thread may use. Returns 0 or an errno. Room that was large enough once is kept:
// further calls allocate nothing.
int cpus_get(struct cpus *cpus);

// Lets the calling thread use these CPUs only. Returns 0 or an errno.
int cpus_use(const struct cpus *cpus);

// Pins the calling thread to one CPU; `room` becomes the set of it alone. Returns 0 or an errno.
int cpus_pin(struct cpus *room, int cpu);

// CPUs are numbered below this.
int cpus_end(const struct cpus *cpus);

void cpus_free(struct cpus *cpus);
