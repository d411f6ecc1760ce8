// Rays among the copies of repeated shapes, by closed forms.
#pragma once

#include "simd/simd.h"
#include "types/known_scene.h"

struct job;
struct packet_ray;
struct primary_hit;

#define REPEATED(shape) ((shape)->repeated)

#define REPEATS(scene) (KNOWN(scene)->repeats)

// A loop over the shapes that share the grid of `first`. An unrolled loop visits every shape; its body leaves
// out other grids.
static inline int grid_begin(int first) {
    return UNROLLED_SHAPES ? 0 : first;
}

static inline bool grid_more(int i) {
    return UNROLLED_SHAPES ? i < UNROLLED_SHAPES : i >= 0;
}

static inline int grid_next(const struct prepared *scene, int i) {
    (void)scene; // unused in a kernel
    return UNROLLED_SHAPES ? i + 1 : KNOWN(scene)->primitives[i].next_same_grid;
}

// Returns whether camera rays send no shadow and no mirror rays.
static inline bool needs_no_secondary(const struct known_model *model) {
    return model->shadows == SHADOWS_NONE &&
           !(model->features.mirrors && model->march.max_bounces > 0);
}

// Rays among the copies of a repeated shape.
struct repeated_query {
    struct vec origin, rest; // in the shape's frame, wrapped into the cell about 0; its low part
    struct vec direction;    // in world axes
    vmask active, leaves;    // leaves: rays that start on the copy about 0 and cannot hit it
    vfloat end;              // hits beyond this t do not matter
};

// Returns the distance to the bounds, a little more than exact: in_bounds() decides exactly.
static inline vfloat bounds_distance(struct vec origin, struct vec direction,
                                     const struct limits *limits) {
    float radius = (float)limits->bounds_radius * (1.0f + 1e-4f);
    vfloat along = vec_dot(origin, direction),
           inside = v_splat(radius * radius) - vec_dot(origin, origin);
    return v_sqrt(v_max(v_madd(along, along, inside), v_splat(0.0f))) - along;
}

// As enter(): returns the rays that enter a copy ahead of them; *local: the point in that copy's frame.
KERNEL_SHARED vmask enter_cells(const struct primitive *s, const struct repeated_query *among,
                                vfloat *t, struct vec *local);

// As hit_from_surface(), first_entry() and block_light() for a solid.
KERNEL_SHARED vmask hit_cells(const struct packet_ray *ray, const struct primitive *s, vmask self,
                              vfloat end, float offset, vfloat *t, struct vec *local);

KERNEL_SHARED vmask shadow_enters_cells(const struct primitive *s, struct vec origin,
                                        struct vec to_light, vmask self, vmask active, vfloat end,
                                        vfloat *t, struct vec *at);

KERNEL_SHARED vmask cells_occlude(const struct primitive *s, struct vec origin,
                                  struct vec direction, vmask self, vmask active, vfloat reach);

// The grid of a tile's blocks in the picture's plane at distance 1: its left and top, and the width of a
// pixel.
struct block_grid {
    float left, top, pixel;
    int across, down; // blocks in the picture
};

// Intersects a tile's packets with all shapes of the grid of `first`. Does nothing if `first` is not the
// leader of its grid.
KERNEL_INLINE void hit_repeated(int first, const struct block_grid *blocks, const struct job *job,
                                struct primary_hit *hits);
