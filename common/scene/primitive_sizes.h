// The sizes of a shape, by type, as the distances of opt2 to opt4 need them (scene/shape_sizes.h sets them). Included in
// their struct primitive. `real` is the phase's number.
#pragma once

union {
    struct {
        real radius, radius_sq; // radius_sq: of opt4
    } sphere;
    struct {
        real half_size[4], rounding; // the fourth is 0, of a register in opt2+horizontal
    } box;                           // and rounded box
    struct {
        real major_radius, minor_radius;
    } torus;
    struct {
        real bottom_radius, top_radius, half_height;
        real side[2], inv_side_sq; // the side from the bottom rim to the top rim; 1/|side|²
    } cone;                        // and capsule: bottom_radius, half_height
    struct {
        real radius;
    } octahedron;
    struct {
        real normal[4], offset;
    } plane;
    struct {
        real bailout;
        int iterations;
    } mandelbulb;
    struct {
        real scale, stretch, fold_limit; // stretch: |scale|
        real inner_sq, outer_sq;         // squares of the radii
        int iterations;
    } mandelbox;
    struct {
        real inv_radii[3], least;
    } ellipsoid;
    struct {
        real frequency, scale, half_thickness;
    } gyroid;
    struct {
        const struct instruction *program;
        int length;
        real inv_lipschitz, extent; // extent: of the sphere about it, of opt4
    } group;
};
