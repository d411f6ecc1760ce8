// Repeated shapes: their copies along a ray, by closed forms.
#ifndef OPT9_REPEATED_RAYS_H
#define OPT9_REPEATED_RAYS_H

#include "core/known_scene.h"
#include "simd/vec.h"

struct job;
struct packet_ray;
struct primary_hit;
struct shadow_rays;

#define REPEATED(shape) ((shape)->repeated)

#define REPEATS(scene) (KNOWN(scene)->repeats)

// A loop over the shapes that share the grid of cells of the shape `first`. An unrolled loop takes every shape in
// turn, and the loop's body leaves out those of another grid.
static inline int grid_begin(int first) {
    return UNROLLED_SHAPES ? 0 : first;
}

static inline bool grid_more(int i) {
    return UNROLLED_SHAPES ? i < UNROLLED_SHAPES : i >= 0;
}

static inline int grid_next(const struct prepared *scene, int i) {
    (void)scene; // not in a kernel
    return UNROLLED_SHAPES ? i + 1 : KNOWN(scene)->primitives[i].next_same_grid;
}

// Nothing waits for what a camera ray has met: it sends no shadow and no mirror ray.
static inline bool needs_no_secondary(const struct known_model *model) {
    return model->shadows == SHADOWS_NONE &&
           !(model->features.mirrors && model->march.max_bounces > 0);
}

// Rays among the copies of a repeated shape.
struct repeated_query {
    struct vec origin, rest; // in the shape's frame, in the cell about 0; what float has lost of it
    struct vec direction;    // in the world's axes
    vmask active, leaves;    // leaves: they start on the copy about 0, and do not meet it
    vfloat end;              // nothing is asked behind it
};

// A hit behind the bounds is none; a little further than they are, for in_bounds() tells that exactly.
static inline vfloat bounds_distance(struct vec origin, struct vec direction,
                                     const struct limits *limits) {
    COUNT(bounds_distance, call);
    COUNT(bounds_distance, scalar);
    float radius = (float)limits->bounds_radius * (1.0f + 1e-4f);
    vfloat along = vec_dot(origin, direction),
           inside = v_splat(radius * radius) - vec_dot(origin, origin);
    return v_sqrt(v_max(v_madd(along, along, inside), v_splat(0.0f))) - along;
}

// As enter(): where they enter a copy ahead of them, and the point there in that one's frame.
KERNEL_SHARED vmask enter_cells(const struct primitive *s, const struct repeated_query *among,
                                vfloat *t, struct vec *local);

// As hit_from_surface(), first_entry() and what hard shadows ask of a solid.
KERNEL_SHARED vmask hit_cells(const struct packet_ray *ray, const struct primitive *s, vmask self,
                              vfloat end, float offset, vfloat *t, struct vec *local);

KERNEL_SHARED void first_entry_in_cells(const struct primitive *s, int i, struct shadow_rays *r,
                                        const struct limits *limits);

KERNEL_SHARED vmask cells_occlude(const struct primitive *s, struct vec origin,
                                  struct vec direction, vmask self, vmask active, vfloat reach);

// The planes through the camera between the tile's columns and rows of blocks, as it sees the picture's plane at
// distance 1: their places there.
struct block_grid {
    float left, top, pixel; // pixel: its width
    int across, down;       // blocks in the picture
};

// What a tile's packets meet of all shapes that are repeated as the shape `first` is, if it is the first of them.
KERNEL_INLINE void hit_repeated(int first, const struct block_grid *blocks, const struct job *job,
                                struct primary_hit *hits);

#endif
