// A shape in the form that opt6_wide and the phases that derive from it evaluate. No lanes in here. Included by
// core/prepared.h, after scene.h and eval_kind.h.
#pragma once

struct field;   // opt9_convex: fields/field.h
struct program; // groups/program.h
struct sharp;   // opt9_convex: hit/sharp.h

// What a shape's distance bounds. BOUND_LIPSCHITZ: two points differ in it by at most their distance. BOUND_BALL:
// nothing is hit outside of a ball of radius `a`, where it is at least half of the way to the ball. BOUND_NONE: it
// jumps.
enum bound_kind { BOUND_LIPSCHITZ, BOUND_BALL, BOUND_NONE };

// Lengths are in scene units. A generated kernel (opt10_scene) has the members that kernel/generate.c writes.
struct primitive {
    enum eval_kind eval;
    enum shape_type type;
    bool turned, repeated;
    bool steady; // its distance changes no faster than the point moves: see scene_distances()
    float slack; // rounding error of its distance within the shape
    float index; // in the scene
    float position[3], position_lo[3];
    float turn[3][3]; // the rotation from world to local axes, by rows
    float cell[3], per_cell[3];
    float normal[3];              // plane: in the world's axes
    float a, b, c;                // sizes: see prepare_shape()
    float slope[2], per_slope_sq; // cone: from the bottom rim to the top rim, 1/|slope|²
    float size[3];                // box: half size; plane: normal; Mandelbox: squares of its radii
    float bailout;
    int iterations;
    const struct program *program; // of a group
    const struct field *field;     // of a group, whose `position` and `centre` are its sphere's
    const struct sharp *sharp;     // of a group of solids; NULL: not one
    // For cones and bundles (opt7_tiles). error: of rounding, by its size.
    enum bound_kind trust;
    float error;
    // For closed forms and for the cones of shadows (opt8_streams, opt9_convex): the radius of a sphere about `position`
    // that holds the shape; infinite for a plane.
    float bound, bound_sq;
    bool convex;
    // Shadow cones must miss it (opt8_streams): q, q·bound, 1 − q². over: a plane's offset from the world's origin.
    float slope_lit, slope_bound, slope_a, over;
    // Its material. share: the weight of the mirror ray. Below the cosine shine_from, the highlight is less than 1e-9
    // of the light.
    float color[3], share, shininess, shine_from;
    // For a repeated shape (opt9_convex): half of a box that holds it, and the rounding of a walk through its cells.
    // Repeated shapes with the same frame and cells share a grid. `leader`: the first of them, itself if not
    // repeated; next_same_grid: the next, −1: none. The leader's box_of_grid holds them all.
    float box[3], box_of_grid[3];
    int next_same_grid, leader;
    bool follows_same_grid; // it is not the leader of its grid
    int bvh_rank;           // with a BVH: the solid's index among the leaves
    // For ray origins, which are moved into the shape's frame in double and then rounded once: position, rows of the
    // shape's matrix (linear plane: its normal in the world's axes), cells.
    double centre[3], row[3][3], offset, radius_sq, wide_cell[3], wide_per_cell[3];
};

// Shapes by their index in the scene.
struct shape_list {
    int count, steady; // steady: how many of the shapes are
    const int *shape;  // in the scene's order
    const int *order;  // of evaluation: steady shapes first, then by type
    bool fractal;      // a ray may hit a fractal: then the list has all shapes (opt7_tiles)
};
