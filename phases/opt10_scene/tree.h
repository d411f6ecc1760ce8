// The bounding spheres of many shapes, sixteen to a node, the nodes sixteen to a node above: a shallow tree, whose
// nodes' children are all tested at once (H. Dammertz, J. Hanika and A. Keller, "Shallow bounding volume hierarchies
// for fast SIMD ray tracing of incoherent rays", EGSR 2008). No lanes in here.
#ifndef OPT10_TREE_H
#define OPT10_TREE_H

#include <stdbool.h>

enum { TREE_WIDTH = 16, TREE_LEVELS = 3 }; // 16³ are as many shapes as a scene can have

struct spheres {
    int count;
    float *x, *y, *z, *radius; // room for whole nodes; what is behind `count` is never looked at
};

struct tree {
    int levels; // 0: there is none
    struct spheres
        level[TREE_LEVELS]; // entry i of a level holds entries 16·i to 16·i + 15 of the level below
    int *shape;             // the shape of each entry of level 0
    float centre[3], radius; // of a sphere about all
    float spacing;           // a typical radius of a node of level 1
    float *memory;
};

// A sphere to be put into a tree. `key`: for the sorting.
struct leaf {
    float centre[3], radius, key;
    int shape;
};

// Room for that many leaves, to be freed with tree_free; false: out of memory.
bool tree_reserve(struct tree *tree, int leaves);
// In the order of the leaves that is best for the tree, which they are left in.
void tree_build(struct tree *tree, struct leaf *leaves, int count);
void tree_free(struct tree *tree);
// How far it is from the centre of leaf i to the nearest of the other leaves' spheres; ∞: there is none, 0 or
// less: it is in one.
float tree_gap(const struct tree *tree, int i);

#endif
