// A bounding volume hierarchy of spheres, 16 children per node. It is shallow, and the children of a node are
// tested at once (H. Dammertz, J. Hanika and A. Keller, "Shallow bounding volume hierarchies for fast SIMD
// ray tracing of incoherent rays", EGSR 2008). No vectors here.
#pragma once

#include <stdbool.h>

enum { BVH_WIDTH = 16, BVH_LEVELS = 3 }; // 16³ = 4,096 = SCENE_MAX_SHAPES

struct sphere_array {
    int count;
    float *x, *y, *z, *radius; // allocated for whole nodes; entries from `count` on are unused
};

struct bvh {
    int levels; // 0: no BVH
    struct sphere_array
        level[BVH_LEVELS]; // entry i of a level holds entries 16·i to 16·i + 15 of the level below
    int *shape;            // the shape of each entry of level 0
    float centre[3], radius; // of a sphere that holds all leaves
    float spacing;           // mean radius of the nodes of level 1
    float *memory;
};

// A leaf before the BVH is built. key: for sorting.
struct bvh_leaf {
    float centre[3], radius, key;
    int shape;
};

// Allocates room for that many leaves, freed by bvh_free(). Returns false if memory is short.
bool bvh_reserve(struct bvh *tree, int leaves);
// Builds the BVH and leaves the leaves in its order.
void bvh_build(struct bvh *tree, struct bvh_leaf *leaves, int count);
void bvh_free(struct bvh *tree);
