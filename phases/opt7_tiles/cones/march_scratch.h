// A worker's memory: rays in the frames of all shapes, and lists of shapes.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

struct local_ray; // core/shape_distances.h

// Levels of cones. A cone covers a square of pixels. Above the lowest level, 0, it has four cones below it.
enum { CONE_LEVELS = 2 };

// A worker's memory, of the size that march_scratch_size() returns.
struct march_scratch {
    int packets;  // in the largest group: GROUP if the scene has a fractal, else SMALL_GROUP
    vfloat *wake; // of the rays that march: `packets` for each shape
    struct local_ray *local;
    vfloat *probe_wake;         // of rays that only ask for bounds: axes of cones and bundles
    struct local_ray *probe;    // the axis of a bundle
    vfloat *distance;           // at the ends of a bundle's intervals
    struct local_ray *axis;     // of cones
    vmask *levels[CONE_LEVELS]; // lanes whose cone can meet the shape, for the cones of each level
    vmask *met;                 // the level of the cones that march now
    // The shapes that cones of a level have met: the list of the next level.
    int *offered[CONE_LEVELS];
    // Lists: in the scene's order, then again in the order of evaluation.
    int *patch, *mirror, *shadow;
    bool *wanted; // whether each shape goes on the list in work
};

size_t march_scratch_size(const struct model *model);
struct march_scratch march_scratch_of(void *memory, const struct model *model);
