// What tile.c, trace.c and shade.c call of each other.
#ifndef PACKETS_TRACE_H
#define PACKETS_TRACE_H

#include "simd/permute.h"
#include "solids.h"

enum {
    BATCH = 256,               // rays that go through the tree together
    ROOM = BATCH + MOST_LANES, // a packet may be written behind the last ray
    PACKETS = BATCH / LANES,
    TILE = 16, // pixels on a side: one batch
    BLOCK_WIDTH = 4,
    BLOCK_HEIGHT = LANES / BLOCK_WIDTH
};

// Rays as arrays. Arrays have room for whole packets; what is behind `count` may be anything.
struct beams {
    const float *origin[3], *direction[3];
    const float *near, *far; // of their length; NULL: 0, ∞
    const float *own;        // the shape that each leaves, which it does not meet again; NULL: none
    int count;               // at most BATCH
};

// Where rays that begin outside of all shapes first enter one, and which (−1: none, t = ∞; the first in the scene where
// several are as near). One that begins within a shape meets it at once, as a march does: t is minus the depth.
void first_hits(const struct prepared *scene, const struct beams *beams, float *t, float *shape);

// t = −∞ where a shape lies between near and far; else far, or ∞.
void blocked(const struct prepared *scene, const struct beams *beams, float *t);

// What one worker needs, all its own: arrays that are written at every tile.
struct rays {
    float origin[3][ROOM], direction[3][ROOM];
    float weight[ROOM], pixel[ROOM], own[ROOM];
    int count;
};

struct desk {
    struct rays rays, mirrored;
    float t[ROOM], shape[ROOM], normal[3][ROOM];
    // Shadow rays, from the light to the points: direction, length, the light that they would bring, and to whom.
    float to_point[3][ROOM], from_light[3][ROOM], length[ROOM], skipped[ROOM], lit[3][ROOM],
        slot[ROOM], reach[ROOM], lit_own[ROOM];
    int shadows;
    float color[3][ROOM];
};

struct work {
    const struct prepared *scene;
    const struct view *view;
    struct desk *desk;
};

// Adds to desk->color what the rays bring; what their hits mirror is in desk->mirrored. `normals`: they are kept in
// desk->normal.
void shade(const struct work *work, int bounce, bool normals);

static inline struct vec load_vec(const float *const from[3], int i) {
    return (struct vec){v_load(from[0] + i), v_load(from[1] + i), v_load(from[2] + i)};
}

static inline void unload_vec(struct vec a, float (*to)[ROOM], int i) {
    v_store(a.x, to[0] + i);
    v_store(a.y, to[1] + i);
    v_store(a.z, to[2] + i);
}

static inline void pack_vec(vmask m, struct vec a, float (*to)[ROOM], int i) {
    v_compress_store(m, a.x, to[0] + i);
    v_compress_store(m, a.y, to[1] + i);
    v_compress_store(m, a.z, to[2] + i);
}

#endif
