// Groups as programs: a tree of shapes and operations in postfix form. No lanes in here.
#pragma once

#include "core/prepared.h"

// A node of a group's tree (scene.h) in the form that a program needs. Bounds are in its parent's coordinates.
struct group_node {
    struct primitive shape; // its frame; of NODE_SHAPE: type and sizes
    enum operation operation;
    float blend, per_blend; // k and 1/k
    bool moved;             // its frame is not its parent's
    bool mirror[3];
    bool
        bent; // within a twist or a repeated cell: a ball of its parent's points is no ball of its own
    bool jumps; // its field jumps at the walls of repeated cells: no slope bounds it
    float twist, twist_radius, twist_inner, amplitude, frequency[3], shell, offset;
    float color[3], reflectivity, shininess; // of NODE_SHAPE
    float lipschitz, growth, centre[3], radius;
};

// What a step does with the stack of points and the stack of distances. SHAPE pushes a distance. FOLD replaces the
// last `count` distances by their operation. ENTER pushes a point, in a node's frame. LEAVE takes the point off, and
// changes the last distance by the node's displacement, shell and offset. CLUSTER does nothing: it stands before
// `count` shapes that have a common bound (opt7_tiles).
enum step_kind { STEP_SHAPE, STEP_ENTER, STEP_FOLD, STEP_LEAVE, STEP_CLUSTER };

struct step {
    unsigned char kind;
    bool
        first; // SHAPE: in the point's own frame. FOLD: the operation's first child is among its distances. CLUSTER: its
               // union's first
    short count;
    int node; // CLUSTER: the index of its bound
};

// A sphere about some of a union's shapes, in their parent's coordinates. `left`: clusters of the union from here on.
struct cluster {
    float centre[3], radius, growth;
    int left;
};

struct program {
    const struct step *steps;
    const struct group_node *nodes;
    const struct cluster *clusters;
    int length, shapes;
    int values, points;      // the greatest depths of the stacks
    float scale;             // a group's distance is its root's field times this: 1/lipschitz
    float error;             // rounding error of its field
    float beside;            // its gradient and its differences need points this near
    float centre[3], radius; // sphere about the solid, in the group's frame; radius INFINITY: none
};

// The groups of a scene: one program for each shape that is a group, in their order.
struct groups {
    struct program *programs;
    struct group_node *nodes;
    struct step *steps;
    struct cluster *clusters;
};

// Reserves memory for the scene's groups. Returns NULL if it has none, or if memory is short.
struct groups *groups_reserve(const struct model *model);

// Writes the programs of the scene's groups and gives them to its shapes. The shapes must be prepared.
void compile_groups(struct prepared *prepared);

// Returns an upper bound of a program's steps.
static inline size_t most_steps(size_t nodes) {
    return 4 * nodes;
}
