// The scene: what a JSON file says, checked, in double precision.
//
// A scene falls into two parts, and the type system keeps them apart: `struct model` (shapes,
// materials, limits) is what phase_prepare() may look at and keep; `struct view` (camera, light) is
// what only the timed phase_render() gets, anew for each frame. Angles are degrees, lengths scene
// units, colours linear RGB. The format is in common/scenes/README.md.
#ifndef STEPWISE_SCENE_H
#define STEPWISE_SCENE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SCENE_MAX_SHAPES = 4096, SCENE_ERROR_SIZE = 1024 };

enum shape_type {
    SHAPE_SPHERE,
    SHAPE_BOX,
    SHAPE_TORUS,
    SHAPE_CONE,
    SHAPE_OCTAHEDRON,
    SHAPE_PLANE,
    SHAPE_MANDELBULB,
    SHAPE_ROUNDED_BOX, // in the file a box whose rounding is not 0: what has none pays for none
    SHAPE_TYPES
};

enum shadows { SHADOWS_NONE, SHADOWS_HARD, SHADOWS_SOFT };

enum path_type { PATH_NONE, PATH_CIRCLE, PATH_LINE };

// How a shape moves in an animation. At time 0 it is at its position, which is all that a still picture knows.
struct path {
    enum path_type type;
    double period;  // seconds
    double axis[3]; // of a circle: unit length, turned about by the right hand
    double foot[3]; // of a circle: the point of its axis that is nearest to the shape's position
    double to[3];   // of a line: its other end, reached after half a period
};

struct shape {
    enum shape_type type;
    int material;       // index into model.materials
    double position[3]; // of the shape's frame, at time 0
    struct path path;
    double rotation_degrees[3]; // about x, then y, then z
    double repeat[3];           // cell size per axis, 0 = not repeated
    union {
        struct {
            double radius;
        } sphere;
        struct {
            double half_size[3];
            double rounding; // what it is grown by: its distance is that much less
        } box;
        struct {
            double major_radius, minor_radius; // about the y axis
        } torus;
        struct {
            double bottom_radius, top_radius, half_height; // along the y axis, capped
        } cone;
        struct {
            double radius; // from the centre to a vertex
        } octahedron;
        struct {
            double normal[3], offset; // n·p = offset, n of unit length; solid below
        } plane;
        struct {
            double power, bailout; // power is 8
            int iterations;
        } mandelbulb;
    };
};

struct material {
    double color[3];
    double reflectivity; // 0 = not a mirror
    double shininess;
};

struct limits {
    int max_steps;         // evaluations in one march
    double hit_distance;   // a smaller distance is a hit
    double bounds_radius;  // a ray further than this from the origin has missed
    int max_bounces;       // mirror bounces
    double normal_step;    // of the finite difference
    double surface_offset; // where a secondary ray starts
};

// What the scene uses, so that nothing else is evaluated, counted or drawn.
struct features {
    bool rotation, repetition, mirrors, fog;
    bool motion;            // a shape has a path
    int count[SHAPE_TYPES]; // shapes of each type
};

struct model {
    int shape_count, material_count;
    struct shape *shapes;
    struct material *materials;
    struct limits march;
    double background[3];
    double fog; // k in colour·exp(−k·|p|³)
    enum shadows shadows;
    double shadow_strength;
    struct features features;
    bool animated; // not the scene's: each frame has its shapes elsewhere (render --frames)
};

struct view {
    double position[3];
    double right[3], up[3], forward[3]; // orthonormal camera frame
    double tan_half_fov;                // of the vertical angle
    double light_position[3];
    double light_emission[3];
};

struct scene {
    struct model model;
    struct view view;
    char name[64]; // the file's name without folder and ending
    char hash[17]; // 64-bit FNV-1a of the canonical JSON, hexadecimal; overrides change it
};

struct scene_overrides {
    double hit_distance; // 0 = the scene's own
    int max_steps;       // 0 = the scene's own
};

// Reads and checks the file. Returns false with one line in `error` (at least SCENE_ERROR_SIZE
// bytes): `file:line:column: what` for broken JSON, `file: $.path: what` for anything else.
bool scene_load(const char *path, const struct scene_overrides *overrides, struct scene *scene,
                char *error);
void scene_free(struct scene *scene);

// Puts each shape where it is after so many seconds (before time 0 too). `moved` is a copy of `model` with as
// many shapes of its own.
void model_move(const struct model *model, double seconds, struct model *moved);

const char *shape_type_name(enum shape_type type);
const char *shadows_name(enum shadows shadows);

#endif
