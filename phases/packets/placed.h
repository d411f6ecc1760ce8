// What render.c prepares once, and what it calls of the kernels, which are built for 4, 8 and 16 lanes: no lanes in
// here.
#ifndef PACKETS_PLACED_H
#define PACKETS_PLACED_H

#include <stdbool.h>
#include <stddef.h>

#include "phase.h"
#include "settings.h"
#include "tree.h"

// A shape as shading wants it: what a ray is tested against lies apart, in the tree's leaves (struct hot).
struct placed {
    enum shape_type type;
    bool turned;
    float position[3], turn[3][3]; // rows: the three rotations as one matrix
    float size[3];           // box: half size; sphere: radius; cone: see place_shape() in render.c
    float cosine;            // cone: of the slope
    float normal[3], offset; // plane, in the world's axes: n·p = offset
    float color[3], share, shininess; // share: of what it mirrors
};

struct prepared {
    struct model model;
    struct placed *placed; // one per shape
    int *planes;           // unbounded: in no tree
    int plane_count;
    struct tree tree;
    struct settings settings;
    char said[64]; // the settings, in words
};

// One frame's work for all workers.
struct job {
    const struct prepared *prepared;
    const struct view *view;
    struct frame *frame;
};

#define KERNEL(width)                                                                              \
    size_t width##_own_size(void);                                                                 \
    int width##_tiles(const struct frame *frame);                                                  \
    void width##_tile(const struct job *job, int tile, void *own);                                 \
    void width##_hits(const struct prepared *prepared, const struct ray_set *rays, size_t first,   \
                      size_t count);
KERNEL(lanes4)
KERNEL(lanes8)
KERNEL(lanes16)
#undef KERNEL

#endif
