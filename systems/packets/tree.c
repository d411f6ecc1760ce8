// Builds and frees a tree: bvh.c and kd.c divide the solids, leaves.c keeps them.
#include "builders.h"

bool tree_build(struct tree *tree, enum tree_kind kind, int width,
                const struct bounded_solid *solids, int count) {
    tree->kind = kind;
    tree->width = width;
    tree->bounds = EMPTY_BOX;
    tree->nodes = tree->kds = tree->leaves = 0;
    for (int type = 0; type < SOLIDS; type++)
        tree->arrays[type].count = 0;
    int *which = malloc((size_t)count * sizeof *which + 1);
    if (!which)
        return false;
    for (int i = 0; i < count; i++) {
        which[i] = i;
        tree->bounds = box_union(tree->bounds, &solids[i].box);
    }
    bool built = true;
    if (count > 0 && kind == TREE_BVH)
        built = build_bvh(tree, solids, which, count);
    else if (count > 0 && kind == TREE_KD)
        built = build_kd(tree, solids, which, count);
    else if (count > 0)
        built = add_leaf(tree, solids, which, count) >= 0;
    free(which);
    return built;
}

void tree_free(struct tree *tree) {
    for (int type = 0; type < SOLIDS; type++) {
        struct solid_arrays *arrays = &tree->arrays[type];
        for (int f = 0; f < MAX_FIELDS; f++)
            free(arrays->field[f]);
        for (int k = 0; k < 3; k++)
            free(arrays->reach[k]);
        free(arrays->index);
    }
    free(tree->boxes);
    free(tree->child);
    free(tree->kd);
    free(tree->leaf);
}
