// The scene as render.c prepares it, and the kernels that it calls. This header has no vectors: the
// kernels are built for 4, 8 and 16 lanes.
#pragma once

#include <stdbool.h>
#include <stddef.h>

#include "phase.h"
#include "tree.h"
#include "workers/workers.h"

// A shape as shading needs it. For intersections a solid stands in the tree's leaves, a plane here.
struct primitive {
    enum shape_type type;
    bool turned;
    float position[3], turn[3][3];    // rows: the three rotations as one matrix
    float size[3];                    // box: half size; sphere: radius; cone: as in its leaf
    float cosine;                     // cone: of its side's slope
    float normal[3], offset;          // plane, in the world's axes: n·p = offset
    float color[3], share, shininess; // share: of the mirrored light
};

struct prepared {
    struct model model;
    struct primitive *primitives; // one per shape
    int *planes;                  // their numbers; no tree holds them, since they have no bounds
    int plane_count;
    struct tree tree;
    struct settings settings;
    char settings_text[64];
};

// One frame's work for all workers.
struct job {
    const struct prepared *prepared;
    const struct view *view;
    struct frame *frame;
};

// The code for one width of lanes: VARIANT(kernel) of tile.c.
struct lane_kernel {
    size_t scratch_size; // bytes of a worker's memory
    int (*tiles)(const struct frame *frame);
    workers_task *tile; // of a struct job
    void (*hits)(const struct prepared *prepared, const struct ray_set *rays, size_t first,
                 size_t count);
};

extern const struct lane_kernel lanes4_kernel, lanes8_kernel, lanes16_kernel;
