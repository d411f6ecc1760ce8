// A worker's memory: rays in the frames of all shapes, and lists of shapes.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

struct local_ray; // core/shape_distances.h

// A worker's memory, of the size that march_scratch_size() returns.
struct march_scratch {
    vfloat *wake; // GROUP for each shape, as `local`: of the rays that march
    struct local_ray *local;
    vfloat *probe_wake;      // of rays that only ask for bounds: axes of cones and bundles
    struct local_ray *probe; // the axis of a bundle
    vfloat *distance;        // at the ends of a bundle's intervals
    struct local_ray *axis;  // of cones
    vmask *met;              // lanes whose cone can meet the shape
    int *offered;            // list of the shapes that wider cones have met
    // Lists: in the scene's order, then again in the order of evaluation.
    int *patch, *mirror, *shadow;
    bool *wanted; // whether each shape goes on the list in work
};

size_t march_scratch_size(const struct model *model);
struct march_scratch march_scratch_of(void *memory, const struct model *model);
