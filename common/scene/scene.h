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

enum { SCENE_MAX_SHAPES = 4096, SCENE_MAX_NODES = 4096, SCENE_MAX_DEPTH = 32 };
enum { SCENE_ERROR_SIZE = 1024 };

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
    SHAPE_GROUP,       // a tree of nodes: a group, and every shape that plain code cannot draw
    SHAPE_TYPES,
    SHAPE_CAPSULE = SHAPE_TYPES, // these only inside nodes
    SHAPE_ELLIPSOID,
    SHAPE_GYROID
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
        double sizes[3];
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
        struct {
            double radius, half_height; // along the y axis: of the cylinder between the half balls
        } capsule;
        struct {
            double radius[3]; // field: (|p/radius| − 1)·the least of them
        } ellipsoid;
        struct {
            double cell, thickness; // field: |sin x cos y + sin y cos z + sin z cos x|·cell/(2π√3)
        } gyroid;                   // − thickness/2, with x = 2πp/cell
        struct {
            int root;                 // index into model.nodes
            const struct node *nodes; // the model's
        } group;
    };
};

enum operation { NODE_SHAPE, NODE_UNION, NODE_INTERSECTION, NODE_DIFFERENCE };

// A node of a group's tree. Nodes stand in prefix order: a node's first child is the next one.
//
// Its field at a point p of its parent's coordinates: q is p in its own coordinates, by position, rotation,
// repeat as of any shape, then mirror. r is q twisted. f is the shape's distance at r, or the operation of the
// children's fields at r. f grows by the displacement at q; then |f| − shell, if there is a shell; then f − offset.
// The distance of a SHAPE_GROUP to every march, shadow and normal is f/lipschitz of its root.
struct node {
    enum operation operation;
    struct shape shape; // its transform, none for a root; of NODE_SHAPE: type, sizes, material
    int end;            // index after its last descendant: of its next sibling, if it has one
    int children;       // 0 of NODE_SHAPE
    double blend;       // k of the smooth minimum; 0: sharp
    bool mirror[3];     // the coordinate's magnitude, after position, rotation and repeat
    // Turns (x, z) by twist·y: to (c·x − s·z, s·x + c·z). A point farther than twist_radius from the y axis is
    // moved towards the axis to that distance first, else the slope would have no bound. There f becomes
    // max(f, its distance from the axis − twist_inner). The solid lies within twist_radius, where nothing changes.
    double twist, twist_radius; // radians per unit; 0: none
    double twist_inner; // twist_radius less the least that f can be there, before displacement
    double amplitude, frequency[3]; // f + amplitude·sin(ω0·qx)·sin(ω1·qy)·sin(ω2·qz); 0: none
    double shell, offset;           // 0: none
    // It or a descendant is repeated, and not its own mirror image at the cell's walls: the field may jump there,
    // and no bound by `lipschitz` holds across. Of a root: its SHAPE_GROUP's repeat counts too.
    bool jumps;
    // What follows is computed by the reader and by model_move. All of it in the parent's coordinates.
    double lipschitz;         // the field's greatest slope, at least 1
    double centre[3], radius; // sphere about the solid, where f < 0; radius INFINITY: none
    double growth;            // 0 to 1: outside the sphere, f ≥ growth·(|p − centre| − radius)
};

// Whether a node's field is the distance to its solid, outside of it. Others are less than that somewhere.
bool node_is_distance(const struct node *nodes, int index);

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
    bool motion;            // a shape or a node has a path
    int count[SHAPE_TYPES]; // shapes of each type
    // What nodes have. The bits above, but for mirrors and motion, are of shapes alone.
    int groups; // = count[SHAPE_GROUP]
    bool blends, displacements, twists;
};

struct model {
    int shape_count, material_count, node_count;
    struct shape *shapes;
    struct node *nodes;
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

// Makes `moved` a copy of `model` with its own shapes and nodes, for model_move. Both are in one piece of memory:
// the caller frees moved->shapes. Returns false if memory is short; moved->shapes is NULL then.
bool model_copy(const struct model *model, struct model *moved);

// Writes the model's shapes and nodes to `moved`, a copy of it, with their positions at `seconds`, which may
// be negative. Spheres and Lipschitz constants of nodes are those of that time.
void model_move(const struct model *model, double seconds, struct model *moved);

// Writes the camera and light at `seconds`, which may be negative. Unless it returns AIM_OK, the path leads
// through look_at, or to where the camera looks along `up`: the view is then of no use.
enum aim scene_view(const struct scene *scene, double seconds, struct view *view);

// The name as in scene files.
const char *shape_type_name(enum shape_type type);
