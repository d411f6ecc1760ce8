// The prepared scene (frame/primitives.c) and one frame's job (frame/render.c). No vectors here: the files that
// are built for 8 and for 16 lanes share this header with the files that are built once.
#pragma once

#include "scene/scene.h"

#include "core/bvh.h"
#include "core/eval_kind.h" // needs scene.h

struct frame;
struct sharp;     // hit/sharp.h
struct field;     // fields/field.h
struct field_set; // fields/field.h

// A Mandelbulb's distance over that to its bounding sphere is no less: bulb/bulb_estimate.h.
#define BULB_SHARE 0.52f

// A shape in the form that the renderer evaluates. Lengths are in scene units. A group is evaluated at a POINT.
struct primitive {
    enum eval_kind eval;
    enum shape_type type;
    bool turned, repeated;
    float index; // the shape's number in the scene
    float position[3];
    float turn[3][3]; // the rotation from world to local axes, by rows
    float cell[3], per_cell[3];
    float normal[3];              // plane: its normal in world axes
    float a, b, c;                // sizes: see prepare_shape() in frame/primitives.c
    float slope[2], per_slope_sq; // cone: from the bottom rim to the top rim, 1/|slope|²
    float size[3];                // box: half size; plane: normal; Mandelbox: squares of its radii
    float bailout;
    int iterations;
    const struct sharp *sharp; // of a group of solids (hit/sharp.h); NULL: not one
    const struct field *field; // of a group, whose `position` and `centre` are its sphere's centre
    float bound, bound_sq; // radius of the bounding sphere about `position`; infinite for a plane
    bool convex;
    float box
        [3]; // repeated: half of a box that holds the shape, and the rounding of a walk through its cells
    // Repeated shapes with the same frame and cells share a grid. `leader`: the first of them, itself if not
    // repeated; next_same_grid: the next, −1: none. The leader's box_of_grid holds them all.
    int next_same_grid;
    bool follows_same_grid; // the shape is not the leader of its grid
    int leader;
    float box_of_grid[3]; // half size
    // Material. share: the weight of the mirror ray. Below the cosine shine_from, the highlight is less than
    // 1e-9 of the light.
    float color[3], share, shininess, shine_from;
    // Position, rotation (linear plane: row[0] is its normal in world axes) and cells in double. A ray's
    // origin is moved into the shape's frame with these and rounded once.
    double centre[3], row[3][3], offset, wide_cell[3], wide_per_cell[3];
};

// Numbers of a shape that generated kernels do not have.
struct primitive_extra {
    float position_lo[3]; // position − (float)position
    double radius_sq;     // EVAL_POWER
    int bvh_rank;         // with a BVH: the solid's index among the leaves
};

// What a generated kernel has as constants (opt10_scene). What may vary between runs of one kernel
// (max_steps, hit_distance) is no member, so that reading it through KNOWN() does not compile.
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
    const struct primitive *primitives; // one per shape
    bool repeats;                       // some shape is repeated
    int plane;                          // index of the first linear plane, −1: none
    int bulbs;                          // number of Mandelbulbs
    float lit_slope;                    // see lit_slope() in frame/primitives.c
};

// How every ray of a frame is drawn. By default the scene decides (frame/render.c, frame/primitives.c);
// STEPWISE_PATH forces one way (frame/draw_path.h).
enum draw_path { PATH_DEFAULT, PATH_LIST, PATH_BVH, PATH_MARCH };

struct prepared {
    struct model model;
    struct known_scene known;
    struct primitive *primitives;   // one per shape, known.primitives
    struct primitive_extra *extras; // one per shape
    struct local_camera *cameras;   // one per shape, set for each frame
    bool analytic;                  // frame/analytic_tile.c can draw the scene
    struct bvh bvh;                 // of the solids; no levels: the scene has none
    struct bvh_leaf *leaves;        // of the BVH
    int *planes, plane_count;
    struct field_set *fields;
    struct sharp *sharps; // room for one per group
    int sharp_count;
    enum draw_path path; // set by phase_prepare, read by prepare_shapes
};

// Scenes with fewer shapes get no BVH unless they march soft shadows (bvh_pays() in frame/primitives.c).
enum { BVH_MIN_SHAPES = 2 * BVH_WIDTH };

// The camera as a shape sees it.
struct local_camera {
    float at[3];     // the camera in the shape's frame; repeated: wrapped into the cell about 0
    float at_low[3]; // repeated: the low part of `at`
    float height;    // plane: of the camera above it
    // Solid: its position in camera axes (right, up, forward). Plane: its normal in camera axes. Repeated:
    // the world's origin minus the camera, in the shape's axes.
    float centre[3];
    float axis[3][3]; // repeated: the camera's right, up and forward in the shape's axes
};

// One frame's work for all workers.
struct job {
    const struct prepared *prepared;
    const struct view *view;
    struct frame *frame;
    const struct local_camera *cameras; // one per shape
    int tile_height;                    // of analytic tiles, in pixels
    bool analytic;                      // draw by frame/analytic_tile.c, else by fallback/march.c
    void *frame_memory;                 // a kernel's, for one frame (opt10_scene)
};
