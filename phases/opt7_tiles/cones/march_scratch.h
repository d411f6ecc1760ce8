// A worker's memory: where rays are in the frames of all shapes, and lists of shapes.
#ifndef MARCH_SCRATCH_H
#define MARCH_SCRATCH_H

#include "core/primitive.h"
#include "simd/simd.h"

struct local_ray; // core/shape_distances.h

// Of cones, each over a square of pixels: of a level above the lowest, 0, it has four below it.
enum { CONE_LEVELS = 2 };

// A worker's memory, of the size that march_scratch_size() says.
struct march_scratch {
    int packets;  // of the largest group: GROUP where a Mandelbulb is, else SMALL_GROUP
    vfloat *wake; // of the rays being marched: for each shape as many as a group may have packets
    struct local_ray *local;
    vfloat *eye_wake; // of cones and bundles
    struct local_ray *eye;
    vfloat *distance;            // at the ends of a bundle's intervals
    struct local_ray *axis;      // of cones
    vmask *levels[CONE_LEVELS];  // lanes whose cone can meet the shape, for the cones of each level
    vmask *met;                  // those of the cones that march now
    int *offered[CONE_LEVELS];   // what the cones of a level can meet: a list for the next one
    int *tile, *mirror, *shadow; // lists: in the scene's order, and behind it in that of evaluation
    bool *wanted;                // of each shape, on the way to a list
};

size_t march_scratch_size(const struct model *model);
struct march_scratch march_scratch_of(void *memory, const struct model *model);

#endif
