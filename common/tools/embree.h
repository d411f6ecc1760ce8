// Embree as a reference for build/NAME/hits: the same rays in the same scene. embree.c implements
// it; built without Embree, embree_create always fails.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "phase.h"

// Rays with their hits: index 0 of t and shape is the phase's, index 1 Embree's. Values as in struct
// ray_set (phase.h). All arrays are parts of `memory`.
struct ray_arrays {
    size_t count;
    float *memory, *origin[3], *direction[3], *far, *t[2], *shape[2];
};

struct embree; // Embree's scene, and a chunk of rays in its own form

// Builds the scene for Embree: spheres as points, planes as squares of four times the bounds. `coherent`: the
// rays go in similar directions. Returns NULL, with `reason`, without Embree or with other shapes.
struct embree *embree_create(const struct model *model, bool coherent, const char **reason);
void embree_destroy(struct embree *embree); // NULL is allowed

// Returns the version of the library that runs, and whether it has native packets of 16.
const char *embree_version(const struct embree *embree);

// How rays are passed to Embree: in packets of 16, one by one, or 256 per call.
enum embree_mode { EMBREE_PACKETS, EMBREE_SINGLE, EMBREE_STREAM, EMBREE_MODES };

// Returns whether EMBREE_STREAM is available: Embree 4 does not have it.
bool embree_has_streams(const struct embree *embree);

// Traces the rays and writes t[1] and shape[1]; `any`: an occlusion query. Returns the time of the
// tracing in nanoseconds. Converting rays to Embree's form and hits from it, 1,024 rays at a time, is
// not timed. The phase reads and writes plain arrays within its time, which favours Embree.
uint64_t embree_trace(struct embree *embree, struct ray_arrays *rays, bool any,
                      enum embree_mode mode);
