// What core/primitives.c works out once, and what core/render.c calls of the kernels, which are built for 8 and for 16 lanes: no
// lanes in here.
#ifndef OPT9_PLACED_H
#define OPT9_PLACED_H

#include <stdbool.h>
#include <stddef.h>

#include "bvh/bvh.h"
#include "phase.h"

// As an unevaluated sum of two floats.
static inline void split(double a, float *hi, float *lo) {
    *hi = (float)a;
    *lo = (float)(a - *hi);
}

// What is evaluated along a ray: the shape's distance at a point of its frame; for a plane that is
// not repeated, a line in t; for a sphere wider than the bounds, its power, a polynomial in t.
enum eval_kind { EVAL_POINT, EVAL_LINEAR, EVAL_POWER };

// A shape as the march wants it: what is evaluated, and nothing else.
struct primitive {
    enum eval_kind way;
    enum shape_type type;
    bool turned, repeated;
    float index; // in the scene
    float position[3];
    float turn[3][3]; // rows: the three rotations as one matrix
    float cell[3], per_cell[3];
    float normal[3];              // plane: in the world's axes
    float a, b, c;                // sizes: see prepare_shape() in core/primitives.c
    float slope[2], per_slope_sq; // cone: from the bottom rim to the top rim, 1/|slope|²
    float size[3];                // box: half size; plane: normal
    float bailout;
    int iterations;
    float bound, bound_sq; // of a sphere about its position that holds the shape; ∞: there is none
    bool convex;
    float box
        [3]; // repeated: half of a box that holds it, and the rounding of a walk through its cells
    // Repeated: the next shape that is so in the same frame, −1: none; whether there is one before; of the first of
    // them half of a box about all.
    int next_same_grid;
    bool follows_same_grid;
    int leader; // the first of them; of every other shape itself
    float box_of_grid[3];
    // Its material; share: of what a mirror shows. Where the light's mirror image is at a cosine below
    // shine_from, its highlight is less than 1e-9 of the light.
    float color[3], share, shininess, shine_from;
    // For the ray's origin, which is moved into the shape's frame in double and then rounded once:
    // position, rows of the shape's matrix (linear plane: its normal in the world's axes), cells.
    double centre[3], row[3][3], offset, wide_cell[3], wide_per_cell[3];
};

// What only code for every scene reads of a shape.
struct primitive_extra {
    float position_lo[3]; // what `position` lacks
    double radius_sq;     // EVAL_POWER
    // Of a crowd's solid: no other's bounding sphere is nearer to its position, and its place in the tree.
    float alone;
    int bvh_rank;
};

// A scene as code that is compiled for it knows it, by constants. A type of its own: what may differ between runs of the
// same code (max_steps, hit_distance) is not in it, and to read that through KNOWN is an error of the compiler's.
struct known_limits {
    double bounds_radius, normal_step, surface_offset;
    int max_bounces;
};
struct known_features {
    bool rotation, repetition, mirrors, fog;
};
struct known_model {
    int shape_count;
    enum shadows shadows;
    double shadow_strength, fog, background[3];
    struct known_features features;
    struct known_limits march;
};
struct known_scene {
    struct known_model model;
    const struct primitive *placed; // one per shape
    bool repeats;                   // a shape is repeated
    int plane;                      // the first that there is, −1: none
    int bulbs;                      // how many of them are Mandelbulbs
    float lit_slope;                // see lit_slope() in core/primitives.c
};

// How every ray of a frame is drawn. By default the scene decides (core/render.c, core/primitives.c);
// STEPWISE_PATH forces one way (core/draw_path.h).
enum draw_path { PATH_DEFAULT, PATH_LIST, PATH_BVH, PATH_MARCH };

struct prepared {
    struct model model;
    struct known_scene known;
    struct primitive *placed;     // one per shape, known.placed
    struct primitive_extra *more; // one per shape
    struct local_camera *eyes;    // one per shape; of the frame being rendered
    bool solids;                  // core/analytic_tile.c can have it
    struct bvh tree;              // of the solids, if they are a crowd
    struct bvh_leaf *leaves;      // what it is made of
    int *planes, plane_count;
    enum draw_path path; // set by phase_prepare, read by prepare_shapes
};

// A scene of this many shapes is a crowd, of two nodes of the tree or more, where build_bvh() in core/primitives.c allows it.
enum { BVH_MIN_SHAPES = 2 * TREE_WIDTH };

// Room for so many shapes, in what is zeroed; false: memory is short. To be freed in any case.
bool place_room(struct prepared *prepared, int shape_count);
void place_free(struct prepared *prepared);
// All but `eyes`, in arrays that are there.
void prepare_shapes(struct prepared *prepared, const struct model *model);
// A frame's eyes (hit/local_cameras.c). Whether it can be had without marching camera rays. sixteen: lanes, not eight.
bool set_local_cameras(const struct prepared *prepared, const struct view *view, bool sixteen);
// Of the tiles of a frame that is so high.
int tile_height(const struct prepared *prepared, int height);

// The camera as a shape sees it.
struct local_camera {
    float at[3];   // in the shape's frame, of a repeated one in the cell about 0
    float rest[3]; // of a repeated one: what `at` lacks
    float height;  // above a plane
    // The shape's position to the right, above and ahead of the camera; a plane's normal there; of a repeated one the
    // world's origin from the camera in the shape's frame.
    float centre[3];
    float axis[3][3]; // of a repeated one: the camera's right, up and forward in its frame
};

// One frame's work for all workers.
struct job {
    const struct prepared *prepared;
    const struct view *view;
    struct frame *frame;
    const struct local_camera *eyes; // one per shape
    int tile_height;                 // of core/analytic_tile.c's
    bool solids;                     // every ray by core/analytic_tile.c, none by fallback/march.c
};

#define KERNEL(width)                                                                              \
    size_t width##_own_size(const struct model *model);                                            \
    int width##_tiles(const struct job *job);                                                      \
    void width##_tile(const struct job *job, int tile, void *own);                                 \
    bool width##_distances(const struct prepared *prepared, size_t count, const double *points,    \
                           double *distance, int *nearest);
KERNEL(lanes8)
KERNEL(lanes16)
#undef KERNEL

#endif
