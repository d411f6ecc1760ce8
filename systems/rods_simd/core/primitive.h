// The scene in the form that the march needs, prepared by core/prepare_shape.c and core/update.c. No lanes in here.
#pragma once

#include "scene/scene.h"
#include "settings.h"

#include "core/eval_kind.h" // needs scene.h

struct groups;  // groups/program.h
struct program; // groups/program.h

// A shape in the form that the march evaluates.
struct primitive {
    enum eval_kind kind;
    enum shape_type type;
    bool turned, repeated;
    bool steady; // its distance changes no faster than the point moves: see scene_distances()
    float slack; // rounding error of its distance within the shape
    float index; // in the scene
    float position[3], position_lo[3];
    float turn[3][3]; // rows: the three rotations as one matrix
    float cell[3], per_cell[3];
    float normal[3];              // plane: in the world's axes
    float a, b, c;                // sizes: see prepare_shape()
    float slope[2], per_slope_sq; // cone: from the bottom rim to the top rim, 1/|slope|²
    float size[3];                // box: half size; plane: normal; Mandelbox: squares of its radii
    float bailout;
    int iterations;
    const struct program *program; // of a group
    // For ray origins, which are moved into the shape's frame in double and then rounded once: position, rows of the
    // shape's matrix (linear plane: its normal in the world's axes), cells.
    double centre[3], row[3][3], offset, radius_sq, wide_cell[3], wide_per_cell[3];
};

// Shapes by their index in the scene.
struct shape_list {
    int count, steady; // steady: how many of the shapes are
    const int *shape;  // in the scene's order
    const int *order;  // of evaluation: steady shapes first, then by type
};

struct prepared {
    struct model model;
    struct primitive *primitives; // one per shape
    struct groups *groups;        // NULL: the scene has none
    struct shape_list all;
    struct settings settings;
    char said[128]; // the settings, in words
};

// Packets of rays that march together: a group.
enum { GROUP = 4 };
