// Builds the BVH top-down: the leaves are halved along their longest axis, at whole nodes, until one node is
// left.
#include "core/bvh.h"

#include <math.h>
#include <stdlib.h>

static int nodes_for(int entries) {
    return (entries + BVH_WIDTH - 1) / BVH_WIDTH;
}

bool bvh_reserve(struct bvh *tree, int leaves) {
    int room[BVH_LEVELS], all = 0;
    for (int level = 0, entries = leaves; level < BVH_LEVELS; level++) {
        room[level] = nodes_for(entries) * BVH_WIDTH;
        all += room[level];
        entries = nodes_for(entries);
    }
    *tree = (struct bvh){.memory = calloc((size_t)all * 4, sizeof(float)),
                         .shape = calloc((size_t)room[0], sizeof(int))};
    if (!tree->memory || !tree->shape) {
        bvh_free(tree);
        return false;
    }
    float *next = tree->memory;
    for (int level = 0; level < BVH_LEVELS; level++, next += 4 * room[level - 1])
        tree->level[level] = (struct sphere_array){0, next, next + room[level],
                                                   next + 2 * room[level], next + 3 * room[level]};
    return true;
}

void bvh_free(struct bvh *tree) {
    free(tree->memory);
    free(tree->shape);
    *tree = (struct bvh){0};
}

// Equal keys are ordered by shape, so that the order is the same on every machine.
static int by_key(const void *a, const void *b) {
    const struct bvh_leaf *left = a, *right = b;
    if (left->key != right->key)
        return left->key < right->key ? -1 : 1;
    return (left->shape > right->shape) - (left->shape < right->shape);
}

static int longest_axis(const struct bvh_leaf *leaves, int count) {
    int axis = 0;
    float longest = -1;
    for (int k = 0; k < 3; k++) {
        float least = INFINITY, most = -INFINITY;
        for (int i = 0; i < count; i++) {
            least = fminf(least, leaves[i].centre[k]);
            most = fmaxf(most, leaves[i].centre[k]);
        }
        if (most - least > longest) {
            longest = most - least;
            axis = k;
        }
    }
    return axis;
}

// Sorts the leaves into entries of `part` leaves each, and these into the entries of the level below.
static void split_leaves(struct bvh_leaf *leaves, int count, int part) {
    if (count <= part) {
        if (part > BVH_WIDTH)
            split_leaves(leaves, count, part / BVH_WIDTH);
        return;
    }
    int axis = longest_axis(leaves, count), parts = (count + part - 1) / part;
    for (int i = 0; i < count; i++)
        leaves[i].key = leaves[i].centre[axis];
    qsort(leaves, (size_t)count, sizeof *leaves, by_key);
    int first = parts / 2 * part;
    split_leaves(leaves, first, part);
    split_leaves(leaves + first, count - first, part);
}

static void set_sphere(struct sphere_array *to, int i, const float *centre, float radius) {
    to->x[i] = centre[0];
    to->y[i] = centre[1];
    to->z[i] = centre[2];
    to->radius[i] = radius;
}

// Sets the sphere about the bounding box of a node's spheres. The factor 1 + 1e-5 covers rounding.
static void enclosing_sphere(const struct sphere_array *below, int node, float centre[3],
                             float *about) {
    int first = node * BVH_WIDTH, end = first + BVH_WIDTH;
    if (end > below->count)
        end = below->count;
    const float *axes[3] = {below->x, below->y, below->z};
    float radius = 0;
    for (int k = 0; k < 3; k++) {
        float least = INFINITY, most = -INFINITY;
        for (int i = first; i < end; i++) {
            least = fminf(least, axes[k][i] - below->radius[i]);
            most = fmaxf(most, axes[k][i] + below->radius[i]);
        }
        centre[k] = 0.5f * (least + most);
    }
    for (int i = first; i < end; i++) {
        double square = 0;
        for (int k = 0; k < 3; k++)
            square += ((double)axes[k][i] - centre[k]) * ((double)axes[k][i] - centre[k]);
        radius = fmaxf(radius, (float)(sqrt(square) + below->radius[i]));
    }
    *about = radius * (1 + 1e-5f);
}

void bvh_build(struct bvh *tree, struct bvh_leaf *leaves, int count) {
    split_leaves(leaves, count, BVH_WIDTH * BVH_WIDTH);
    tree->level[0].count = count;
    for (int i = 0; i < count; i++) {
        set_sphere(&tree->level[0], i, leaves[i].centre, leaves[i].radius);
        tree->shape[i] = leaves[i].shape;
    }
    tree->levels = count > 0;
    for (int entries = count; entries > BVH_WIDTH; tree->levels++) {
        struct sphere_array *to = &tree->level[tree->levels];
        entries = to->count = nodes_for(entries);
        for (int node = 0; node < entries; node++) {
            float centre[3], radius;
            enclosing_sphere(&tree->level[tree->levels - 1], node, centre, &radius);
            set_sphere(to, node, centre, radius);
        }
    }
    if (count > 0)
        enclosing_sphere(&tree->level[tree->levels - 1], 0, tree->centre, &tree->radius);
    double sum = 0;
    const struct sphere_array *nodes = &tree->level[tree->levels > 1];
    for (int i = 0; i < nodes->count; i++)
        sum += nodes->radius[i];
    tree->spacing = nodes->count ? (float)(sum / nodes->count) : 0;
}
