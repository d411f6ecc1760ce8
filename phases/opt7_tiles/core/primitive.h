// The scene in the form that the march needs, prepared by core/primitives.c and core/update.c. No lanes in here.
#ifndef PLACED_H
#define PLACED_H

#include <stdbool.h>
#include <stddef.h>

#include "phase.h"

// As an unevaluated sum of two floats.
static inline void split(double a, float *hi, float *lo) {
    *hi = (float)a;
    *lo = (float)(a - *hi);
}

// What is evaluated along a ray: the shape's distance at a point of its frame; for a plane that is
// not repeated, a line in t; for a sphere wider than the bounds, its power, a polynomial in t.
enum eval_kind { EVAL_POINT, EVAL_LINEAR, EVAL_POWER };

// What cones and bundles may make of a shape's distance: it changes by no more than the way between two
// points; it is an estimate, but nothing is hit outside of a ball of radius `a`, and there it is at least half
// of the distance to that ball; or, where it jumps at the walls of its cells, nothing.
enum bound_kind { BOUND_LIPSCHITZ, BOUND_BALL, BOUND_NONE };

// A shape as the march wants it: what is evaluated, and nothing else.
struct primitive {
    enum eval_kind kind;
    enum shape_type type;
    bool turned, repeated;
    bool steady; // its distance changes no faster than the place: see scene_distances()
    float slack; // by which scene_distances() mistrusts it, where the place is within the shape
    enum bound_kind trust;
    float error; // what float makes of its distance, for its size
    float index; // in the scene
    float position[3], position_lo[3];
    float turn[3][3]; // rows: the three rotations as one matrix
    float cell[3], per_cell[3];
    float normal[3];              // plane: in the world's axes
    float a, b, c;                // sizes: see prepare_shape() in core/render.c
    float slope[2], per_slope_sq; // cone: from the bottom rim to the top rim, 1/|slope|²
    float size[3];                // box: half size; plane: normal
    float bailout;
    int iterations;
    // For the ray's origin, which is moved into the shape's frame in double and then rounded once:
    // position, rows of the shape's matrix (linear plane: its normal in the world's axes), cells.
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
    struct shape_list all;
};

// Packets of rays that march together: the most in a group. Where there is no Mandelbulb, SMALL_GROUP is enough: more
// packets would share longer lists of shapes.
enum { GROUP = 16, SMALL_GROUP = 4 };

#endif
