// Trees over bounded shapes, built by the surface area heuristic (J. D. MacDonald and K. S. Booth, "Heuristics for ray
// tracing using space subdivision", The Visual Computer 6 (1990)), binned (I. Wald, "On fast construction of SAH-based
// bounding volume hierarchies", IRT 2007): a hierarchy of bounding boxes with as many children a node as there are
// lanes (I. Wald, C. Benthin, S. Boulos, "Getting rid of packets", IRT 2008), a kd-tree (I. Wald, V. Havran, "On
// building fast kd-trees for ray tracing", IRT 2006), or a single leaf.
#ifndef PACKETS_TREE_H
#define PACKETS_TREE_H

#include <stdbool.h>

#include "scene/scene.h"
#include "settings.h"

// Not fminf() and fmaxf(): calls of SSE code, which wait for what AVX-512 has left in the upper halves of the registers
// (spheres40 at n = 180: 26 ms a frame with them, 2 without).
static inline float smaller(float a, float b) {
    return a < b ? a : b;
}

static inline float larger(float a, float b) {
    return a > b ? a : b;
}

enum solid { SOLID_SPHERE, SOLID_BOX, SOLID_CONE, SOLIDS };
enum { MOST_LANES = 16, MOST_FIELDS = 17, MOST_DEPTH = 64 };

// What a ray is tested against, as arrays: a leaf's shapes of a type stand in a row, once for each leaf they are in.
//     sphere: centre (3), radius², then as all: reach about the centre per axis (3), index in the scene
//     box: centre, rows of its matrix (9), half size (3)
//     cone: centre, rows, half height, slope of the radius, radius at the middle
enum { F_CENTRE = 0, F_SQUARE = 3, F_ROW = 3, F_SIZE = 12 };
struct hot {
    int count, room;
    float *field[MOST_FIELDS], *reach[3], *index;
};

struct box {
    float lo[3], hi[3];
};

struct leaf {
    int first[SOLIDS], count[SOLIDS];
};

struct kd_node {
    float split;
    int axis;  // 3: a leaf
    int below; // the child under the split, the other one is next; of a leaf: its number
};

// What is built is from these alone.
struct solid_in {
    enum solid type;
    int index;
    struct box box;
    float field[MOST_FIELDS];
};

struct tree {
    enum tree_kind kind;
    int width;         // of a node: children
    struct box bounds; // of all; empty: lo > hi
    float *boxes;      // of children, node by node: lo x of all, lo y, lo z, hi x, hi y, hi z
    int *child;        // node by node: ≥ 0 a node, < 0 leaf −1 − child; none: its box is empty
    struct kd_node *kd;
    struct leaf *leaf;
    int nodes, node_room, kds, kd_room, leaves, leaf_room;
    struct hot hot[SOLIDS];
};

// A tree of that kind and width over the solids; what it was before is gone. False when memory is short.
bool tree_build(struct tree *tree, enum tree_kind kind, int width, const struct solid_in *solids,
                int count);
void tree_free(struct tree *tree);

#endif
