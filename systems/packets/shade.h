// Shading of a tile's rays, and what a worker needs for it.
#pragma once

#include "trace.h"

// Camera or mirror rays of a tile. A ray adds `weight` times what it sees to its pixel.
struct tile_rays {
    float origin[3][ROOM], direction[3][ROOM];
    float weight[ROOM], pixel[ROOM], excluded[ROOM];
    int count;
};

// One worker's memory. All arrays are written anew for each tile.
struct worker_scratch {
    struct tile_rays rays, mirrored;
    float t[ROOM], shape[ROOM], normal[3][ROOM]; // hits of `rays`
    // Shadow rays, from the light to the hits. A ray that nothing blocks adds `shadow_light` to its
    // pixel.
    float shadow_origin[3][ROOM], shadow_direction[3][ROOM], shadow_near[ROOM], shadow_far[ROOM],
        shadow_excluded[ROOM], shadow_t[ROOM], shadow_light[3][ROOM], shadow_pixel[ROOM];
    int shadows;
    float color[3][ROOM];
};

struct tile_context {
    const struct prepared *scene;
    const struct view *view;
    struct worker_scratch *scratch;
};

// Shades the hits of scratch->rays: adds their light to scratch->color, and queues their mirror
// rays in scratch->mirrored. `normals`: keeps the normals in scratch->normal.
void shade_batch(const struct tile_context *context, int bounce, bool normals);
