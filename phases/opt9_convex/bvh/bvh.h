// The bounding spheres of many shapes, sixteen to a node, the nodes sixteen to a node above: a shallow tree, whose
// nodes' children are all tested at once (H. Dammertz, J. Hanika and A. Keller, "Shallow bounding volume hierarchies
// for fast SIMD ray tracing of incoherent rays", EGSR 2008). No lanes in here.
#ifndef OPT9_BVH_H
#define OPT9_BVH_H

#include <stdbool.h>

enum { BVH_WIDTH = 16, BVH_LEVELS = 3 }; // 16³ are as many shapes as a scene can have

struct sphere_array {
    int count;
    float *x, *y, *z, *radius; // room for whole nodes; what is behind `count` is never looked at
};

struct bvh {
    int levels; // 0: there is none
    struct sphere_array
        level[BVH_LEVELS]; // entry i of a level holds entries 16·i to 16·i + 15 of the level below
    int *shape;            // the shape of each entry of level 0
    float centre[3], radius; // of a sphere about all
    float spacing;           // a typical radius of a node of level 1
    float *memory;
};

// A sphere to be put into a tree. `key`: for the sorting.
struct bvh_leaf {
    float centre[3], radius, key;
    int shape;
};

// Room for that many leaves, to be freed with bvh_free; false: out of memory.
bool bvh_reserve(struct bvh *tree, int leaves);
// In the order of the leaves that is best for the tree, which they are left in.
void bvh_build(struct bvh *tree, struct bvh_leaf *leaves, int count);
void bvh_free(struct bvh *tree);
// How far it is from the centre of leaf i to the nearest of the other leaves' spheres; ∞: there is none, 0 or
// less: it is in one.
float bvh_gap(const struct bvh *tree, int i);

#endif
