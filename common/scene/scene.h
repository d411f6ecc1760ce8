// The scene: the checked contents of a scene file, in double precision.
//
// A scene has two parts. phase_prepare() may read and keep `struct model`: shapes, materials and
// limits. Only the timed phase_render() gets `struct view`, camera and light, new in each frame.
// Angles are degrees, lengths are scene units, colours are linear RGB. common/scenes/README.md
// describes the file format.
#pragma once

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
    SHAPE_MANDELBOX,
    SHAPE_ROUNDED_BOX, // in the file: a box with rounding > 0; plain boxes do not pay for it
    SHAPE_TYPES
};

// SOFT: the paper's estimate of the soft shadow, by its march. IDEAL: the soft shadow itself, the least
// shadow_strength·h(t)/t between surface_offset and the light, from 0 to 1.
enum shadows { SHADOWS_NONE, SHADOWS_HARD, SHADOWS_SOFT, SHADOWS_IDEAL };

enum path_type { PATH_NONE, PATH_CIRCLE, PATH_LINE };

// Whether a shape is a fractal. Its distance is an estimate: a march by it may pass through thin parts.
static inline bool is_fractal(enum shape_type type) {
    return type == SHAPE_MANDELBULB || type == SHAPE_MANDELBOX;
}

// How a shape or the camera moves in an animation. At time 0, and in a still picture, it is at its position.
struct path {
    enum path_type type;
    double period;  // seconds
    double axis[3]; // of a circle: unit length; the position turns about it by the right-hand rule
    double foot[3]; // of a circle: its centre, the axis point nearest to the position
    double to[3];   // of a line: the other end, reached after half a period
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
            double rounding; // the box grows by it: distance = distance to the box − rounding
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
        struct {
            double scale, fold_limit, minimum_radius, fixed_radius;
            int iterations;
        } mandelbox;
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
    double bounds_radius;  // a ray farther than this from the origin has missed
    int max_bounces;       // mirror bounces
    double normal_step;    // step of the finite difference for normals
    double surface_offset; // distance from the surface at which a secondary ray starts
};

// Features that the scene uses. A phase evaluates and counts only these.
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
    bool animated; // set by the driver: shapes move from frame to frame (render --frames)
};

struct view {
    double position[3];
    double right[3], up[3], forward[3]; // orthonormal camera frame
    double tan_half_fov;                // of the vertical angle
    double light_position[3];
    double light_emission[3];
};

// How the camera moves. It looks at the same point from everywhere on its path.
struct flight {
    struct path path;
    double look_at[3], up[3];
};

struct scene {
    struct model model;
    struct view view; // at time 0
    struct flight flight;
    char name[64]; // the file's name without folder and extension
    char hash[17]; // hexadecimal 64-bit FNV-1a hash of the values, overrides included
};

// Limits that replace the scene's.
struct scene_overrides {
    double hit_distance; // 0 = the scene's own
    int max_steps;       // 0 = the scene's own
};

// Reads and checks a scene file. Returns false with one line in `error` (at least SCENE_ERROR_SIZE
// bytes): `file:line:column: message` for broken JSON, `file: $.path: message` for anything else.
// `overrides` may be NULL. The caller frees a loaded scene with scene_free.
bool scene_load(const char *path, const struct scene_overrides *overrides, struct scene *scene,
                char *error);
void scene_free(struct scene *scene);

// Points the camera, whose position is set, at `look_at`: sets right, up and forward. Unless it returns
// AIM_OK, look_at is the position, or `up` is zero or along the view, and the three are of no use.
enum aim { AIM_OK, AIM_AT_ITSELF, AIM_ALONG_UP };
enum aim view_aim(struct view *view, const double look_at[3], const double up[3]);

// Writes the model's shapes to `moved` with their positions at `seconds`, which may be negative.
// `moved` is a copy of `model` with its own array of shapes of the same length.
void model_move(const struct model *model, double seconds, struct model *moved);

// Writes the camera and light at `seconds`, which may be negative. Unless it returns AIM_OK, the path leads
// through look_at, or to where the camera looks along `up`: the view is then of no use.
enum aim scene_view(const struct scene *scene, double seconds, struct view *view);

// Names as in scene files.
const char *shape_type_name(enum shape_type type);
const char *shadows_name(enum shadows shadows);
