// The prepared scene (frame/primitives.c) and one frame's job (frame/render.c). No vectors here: the files that
// are built for 8 and for 16 lanes share this header with the files that are built once.
#pragma once

#include "core/bvh.h"
#include "scene/scene.h"

#include "core/eval_kind.h" // needs scene.h

#include "core/primitive.h" // needs both

struct field_set; // fields/field.h
struct frame;
struct groups; // groups/program.h
struct sharp;  // hit/sharp.h

// A Mandelbulb's distance over that to its bounding sphere is no less: bulb/bulb_estimate.h.
#define BULB_SHARE 0.52f

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
    float lit_slope;                    // see lit_slope() in scene/shadow_bounds.h
};

// How every ray of a frame is drawn. By default the scene decides (frame/render.c, frame/primitives.c);
// STEPWISE_PATH forces one way (frame/draw_path.h).
enum draw_path { PATH_DEFAULT, PATH_LIST, PATH_BVH, PATH_MARCH };

struct prepared {
    struct model model;
    struct known_scene known;
    struct primitive *primitives; // one per shape, known.primitives
    struct groups *groups;        // the groups' programs; NULL: the scene has none
    struct local_camera *cameras; // one per shape, set for each frame
    bool analytic;                // frame/analytic_tile.c can draw the scene
    struct bvh bvh;               // of the solids; no levels: the scene has none
    struct bvh_leaf *leaves;      // of the BVH
    int *planes, plane_count;
    struct field_set *fields;
    struct sharp *sharps; // room for one per group
    int sharp_count;
    const struct group_calls *group_calls; // fields/rays.h; for a generated kernel
    enum draw_path path;                   // set by phase_prepare, read by prepare_shapes
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
