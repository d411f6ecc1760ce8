// Trees over bounded solids, built by the surface area heuristic (J. D. MacDonald and K. S. Booth,
// "Heuristics for ray tracing using space subdivision", The Visual Computer 6 (1990)) over bins (I.
// Wald, "On fast construction of SAH-based bounding volume hierarchies", IRT 2007). A tree is one
// of
//     a BVH with as many children a node as there are lanes (I. Wald, C. Benthin, S. Boulos, "Getting
//     rid of packets", IRT 2008)
//     a kd-tree (I. Wald, V. Havran, "On building fast kd-trees for ray tracing", IRT 2006)
//     a single leaf
#pragma once

#include <stdbool.h>

#include "settings.h"

// In place of fminf and fmaxf, whose SSE code waits for the upper halves of registers that AVX-512
// has written (spheres40 at n = 180: 26 ms a frame with them, 2 without).
static inline float float_min(float a, float b) {
    return a < b ? a : b;
}

static inline float float_max(float a, float b) {
    return a > b ? a : b;
}

enum solid { SOLID_SPHERE, SOLID_BOX, SOLID_CONE, SOLIDS };
enum { MAX_LANES = 16, MAX_FIELDS = 17, MAX_DEPTH = 64 };

// The solids of one type as arrays, leaf by leaf: a solid stands once in each leaf that holds it.
//     sphere: centre (3), radius²
//     box: centre, rows of its matrix (9), half size (3)
//     cone: centre, rows, half height, slope of the radius, radius at the middle
// `reach`: half of the bounding box, per axis. `index`: in the scene.
enum { F_CENTRE = 0, F_SQUARE = 3, F_ROW = 3, F_SIZE = 12 };
struct solid_arrays {
    int count, room;
    float *field[MAX_FIELDS], *reach[3], *index;
};

struct box {
    float lo[3], hi[3];
};

// Where a leaf's solids stand in the arrays of their types.
struct leaf {
    int first[SOLIDS], count[SOLIDS];
};

struct kd_node {
    float split;
    int axis;  // 3: a leaf
    int below; // the child below the split, the other one is next; of a leaf: its number
};

// A solid as the builders get it.
struct bounded_solid {
    enum solid type;
    int index;
    struct box box;
    float field[MAX_FIELDS];
};

struct tree {
    enum tree_kind kind;
    int width;         // children of a BVH's node
    struct box bounds; // of all solids; empty: lo > hi
    float *boxes;      // of children, node by node: lo x of all, lo y, lo z, hi x, hi y, hi z
    int *child; // node by node: ≥ 0 a node, < 0 leaf −1 − child; of no child the box is empty
    struct kd_node *kd;
    struct leaf *leaf;
    int nodes, node_room, kds, kd_room, leaves, leaf_room;
    struct solid_arrays arrays[SOLIDS];
};

static inline int tree_solid_count(const struct tree *tree) {
    return tree->arrays[SOLID_SPHERE].count + tree->arrays[SOLID_BOX].count +
           tree->arrays[SOLID_CONE].count;
}

// Builds a tree of that kind and width over the solids, in place of the tree's former contents.
// Returns false if memory is short.
bool tree_build(struct tree *tree, enum tree_kind kind, int width,
                const struct bounded_solid *solids, int count);
void tree_free(struct tree *tree);
