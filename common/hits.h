// What hits.c and embree.c have in common: rays as arrays, and another tracer beside the phase.
#ifndef STEPWISE_HITS_H
#define STEPWISE_HITS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "phase.h"

// t, shape: of the phase, of the other one.
struct ray_arrays {
    size_t count;
    float *memory, *origin[3], *direction[3], *far, *t[2], *shape[2];
};

struct beside; // Embree, with the scene and the rays in its own form

// NULL, with the reason in `why`, where it was not built with Embree or the scene is not one for it.
struct beside *beside_start(const struct model *model, const struct ray_arrays *rays, bool coherent,
                            const char **why);
const char *beside_version(void);

// Traces the rays, in packets of 16 or each by itself, and writes t[1] and shape[1]. The time of the tracing alone, in
// ns: rays are put back before it, and hits fetched behind it.
uint64_t beside_trace(struct beside *beside, struct ray_arrays *rays, bool any, bool packets);
void beside_end(struct beside *beside);

#endif
