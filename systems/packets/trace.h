// Rays through the scene: batches of them, and what a batch is traced by.
#pragma once

#include "primitive.h"

enum {
    BATCH = 256,             // rays that are traced together
    ROOM = BATCH + MAX_LANES // of an array of rays: the last packet is written whole
};

// Rays as arrays. The arrays have room for whole packets; values behind `count` are not used.
struct ray_batch {
    const float *origin[3], *direction[3];
    const float *near, *far; // ends of each ray; NULL: 0, ∞
    const float *excluded;   // index of the shape that a ray starts on and does not hit; NULL: none
    int count;               // at most BATCH
};

// Sets the distance and index of each ray's first hit: ∞ and −1 for a miss, the shape of lowest
// index among equal distances. For a ray that starts inside of a solid, t is minus its depth there,
// as a march has it.
void find_closest_hits(const struct prepared *scene, const struct ray_batch *batch, float *t,
                       float *shape);

// Sets t to −∞ for each ray with a shape between near and far, else to far.
void find_occluded(const struct prepared *scene, const struct ray_batch *batch, float *t);
