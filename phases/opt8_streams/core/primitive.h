// The scene in the form that the march needs, prepared by core/prepare_shape.c and core/update.c. No lanes in here.
#pragma once

#include <stddef.h>

#include "scene/scene.h"

#include "core/eval_kind.h" // needs scene.h

struct groups;  // groups/program.h
struct program; // groups/program.h

// What a shape's distance bounds. BOUND_LIPSCHITZ: two points differ in it by at most their distance. BOUND_BALL:
// nothing is hit outside of a ball of radius `a`, where it is at least half of the way to the ball. BOUND_NONE: it
// jumps.
enum bound_kind { BOUND_LIPSCHITZ, BOUND_BALL, BOUND_NONE };

// A shape in the form that the march evaluates.
struct primitive {
    enum eval_kind kind;
    enum shape_type type;
    bool turned, repeated;
    bool steady; // its distance changes no faster than the point moves: see scene_distances()
    float slack; // rounding error of its distance within the shape
    enum bound_kind trust;
    float error; // rounding error of its distance, by its size
    float index; // in the scene
    float position[3], position_lo[3];
    float turn[3][3]; // rows: the three rotations as one matrix
    float cell[3], per_cell[3];
    float normal[3];              // plane: in the world's axes
    float a, b, c;                // sizes: see prepare_shape()
    float slope[2], per_slope_sq; // cone: from the bottom rim to the top rim, 1/|slope|²
    float size[3];                // box: half size; plane: normal
    float bailout;
    int iterations;
    const struct program *program; // of a group
    float bound, bound_sq;         // radius of a sphere around its position that holds it
    bool convex;
    float over; // plane: its offset from the world's origin
    float slope_lit, slope_bound,
        slope_a; // shadow cones must miss it: q, q·bound, 1 − q²
    // Its material. `share`: the part that a mirror adds. The highlight is below 1e-9 of the light where the cosine to
    // the mirrored light is below shine_from.
    float color[3], share, shininess, shine_from;
    // For ray origins, which are moved into the shape's frame in double and then rounded once: position, rows of the
    // shape's matrix (linear plane: its normal in the world's axes), cells.
    double centre[3], row[3][3], offset, radius_sq, wide_cell[3], wide_per_cell[3];
};

// Shapes by their index in the scene.
struct shape_list {
    int count, steady; // steady: how many of the shapes are
    const int *shape;  // in the scene's order
    const int *order;  // of evaluation: steady shapes first, then by type
    bool fractal;      // a ray may hit a fractal: then the list has all shapes
};

// bulb/bulb_single.c marches for hit distances below this: above it a hit depends on step lengths, which it has to
// 2⁻¹³ only.
#define BULB_SINGLE_HIT 1e-4

struct prepared {
    struct model model;
    struct primitive *primitives; // one per shape
    struct groups *groups;        // NULL: the scene has none
    struct shape_list all;
    int bulbs;        // number of Mandelbulbs
    bool single_bulb; // one Mandelbulb and at most a plane: see is_single_bulb()
    bool all_bounded; // every shape has a bounding sphere or is a plane: shadow cones apply
    float lit_slope;  // slope of the shadow cones: see core/update.c
};

// Returns the first shape of a type, or NULL.
static inline const struct primitive *single_shape(enum shape_type type,
                                                   const struct prepared *scene) {
    for (int i = 0; i < scene->model.shape_count; i++)
        if (scene->primitives[i].type == type)
            return &scene->primitives[i];
    return NULL;
}

// Packets of rays that march together: a group.
enum { GROUP = 4 };
