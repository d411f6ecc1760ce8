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

struct beside; // Embree, with the scene and some rays in its own form

// NULL, with the reason in `why`, where it was not built with Embree or the scene is not one for it.
struct beside *beside_start(const struct model *model, bool coherent, const char **why);
// Of the library that runs, and whether packets of 16 are its own.
const char *beside_version(const struct beside *beside);

// How its rays are asked: in packets of 16, each by itself, or 256 a call.
enum beside_way { BESIDE_PACKETS, BESIDE_SINGLE, BESIDE_STREAM, BESIDE_WAYS };

// Whether it has BESIDE_STREAM: Embree 4 does not.
bool beside_streams(const struct beside *beside);

// Traces the rays and writes t[1] and shape[1]. The time of the tracing alone, in
// ns: a thousand rays at a time are put into its form before, and their hits fetched behind it, untimed. Ours reads and
// writes plain arrays within its time: what that is worth is the other one's advantage.
uint64_t beside_trace(struct beside *beside, struct ray_arrays *rays, bool any,
                      enum beside_way way);
void beside_end(struct beside *beside);

#endif
