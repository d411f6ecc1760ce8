// Builds the kd-tree (sources: tree.h). A solid is in every leaf that its box meets.
#include "builders.h"

// Cost of a node in tests of a group of solids, and the factor for a split that cuts off empty
// space (Wald and Havran).
static const float KD_NODE_COST = 0.5f, EMPTY_GAIN = 0.8f;

struct split_plane {
    float cost, at;
    int axis; // −1: a leaf costs less
};

// Tries BINS − 1 planes of an axis. Each costs by the number of boxes that begin below and end
// above it.
static void try_planes(const struct tree *tree, const struct bounded_solid *solids,
                       const int *which, int count, const struct box *cell, int axis,
                       struct split_plane *best) {
    float lo = cell->lo[axis], width = cell->hi[axis] - lo, per = BINS / width;
    if (!(width > 0) || !(per < INFINITY))
        return;
    int begin[BINS + 1] = {0}, end[BINS + 1] = {0};
    for (int i = 0; i < count; i++) {
        const struct box *box = &solids[which[i]].box;
        float from = (box->lo[axis] - lo) * per, to = (box->hi[axis] - lo) * per;
        begin[from > 0 ? (from < BINS ? (int)from : BINS - 1) : 0]++;
        end[to > 0 ? (to < BINS ? (int)to : BINS - 1) : 0]++;
    }
    float whole = box_area(cell);
    int left = 0, right = count;
    for (int bin = 1; bin < BINS; bin++) {
        left += begin[bin - 1];
        right -= end[bin - 1];
        struct box below = *cell, above = *cell;
        float at = lo + width * (float)bin / BINS;
        if (!(at > lo && at < cell->hi[axis]))
            continue;
        below.hi[axis] = above.lo[axis] = at;
        float cost = (box_area(&below) * (float)left + box_area(&above) * (float)right) /
                     (whole * (float)tree->width / 4);
        cost = KD_NODE_COST + (left && right ? 1 : EMPTY_GAIN) * cost;
        if (cost < best->cost)
            *best = (struct split_plane){cost, at, axis};
    }
}

static bool split_cell(struct tree *tree, const struct bounded_solid *solids, const int *which,
                       int count, struct box cell, int node, int depth) {
    struct split_plane best = {(float)count / ((float)tree->width / 4), 0, -1};
    if (depth > 0 && count > 1)
        for (int axis = 0; axis < 3; axis++)
            try_planes(tree, solids, which, count, &cell, axis, &best);
    if (best.axis < 0) {
        int leaf = add_leaf(tree, solids, which, count);
        tree->kd[node] = (struct kd_node){0, 3, leaf};
        return leaf >= 0;
    }
    int below = tree->kds;
    for (int i = 0; i < 2; i++)
        if (!reserve_one(&tree->kd, tree->kds++, &tree->kd_room, sizeof *tree->kd))
            return false;
    tree->kd[node] = (struct kd_node){best.at, best.axis, below};
    int *part = malloc((size_t)count * sizeof *part + 1);
    bool built = part != NULL;
    for (int side = 0; side < 2 && built; side++) {
        struct box half = cell;
        (side ? half.lo : half.hi)[best.axis] = best.at;
        int in = 0;
        for (int i = 0; i < count; i++) {
            const struct box *box = &solids[which[i]].box;
            if (side ? box->hi[best.axis] >= best.at : box->lo[best.axis] <= best.at)
                part[in++] = which[i];
        }
        built = split_cell(tree, solids, part, in, half, below + side, depth - 1);
    }
    free(part);
    return built;
}

bool build_kd(struct tree *tree, const struct bounded_solid *solids, const int *which, int count) {
    if (!reserve_one(&tree->kd, tree->kds++, &tree->kd_room, sizeof *tree->kd))
        return false;
    int depth = 8;
    for (int i = count; i > 1; i /= 2)
        depth++;
    return split_cell(tree, solids, which, count, tree->bounds, 0, depth);
}
