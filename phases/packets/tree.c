// The trees' leaves, which hold what rays are tested against, and their beginning and end; bvh.c and kd.c build.
#include "builders.h"

static const int FIELDS[SOLIDS] = {4, 15, 15};

// All arrays of a type are as long, and MOST_LANES longer than what is in them: a group of lanes may be loaded at the
// last one.
static bool grow_hot(struct hot *hot, int type) {
    if (hot->count + MOST_LANES < hot->room)
        return true;
    int room = hot->room ? 2 * hot->room : 4 * MOST_LANES;
    float **arrays[MOST_FIELDS + 4];
    int count = 0;
    for (int f = 0; f < FIELDS[type]; f++)
        arrays[count++] = &hot->field[f];
    for (int k = 0; k < 3; k++)
        arrays[count++] = &hot->reach[k];
    arrays[count++] = &hot->index;
    for (int i = 0; i < count; i++) {
        float *made = realloc(*arrays[i], (size_t)room * sizeof(float));
        if (!made)
            return false;
        memset(made + hot->room, 0, (size_t)(room - hot->room) * sizeof(float));
        *arrays[i] = made;
    }
    hot->room = room;
    return true;
}

static bool add_hot(struct tree *tree, const struct solid_in *s) {
    struct hot *hot = &tree->hot[s->type];
    if (!grow_hot(hot, (int)s->type))
        return false;
    int at = hot->count++;
    for (int f = 0; f < FIELDS[s->type]; f++)
        hot->field[f][at] = s->field[f];
    for (int k = 0; k < 3; k++)
        hot->reach[k][at] =
            larger(s->box.hi[k] - s->field[F_CENTRE + k], s->field[F_CENTRE + k] - s->box.lo[k]);
    hot->index[at] = (float)s->index;
    return true;
}

int add_leaf(struct tree *tree, const struct solid_in *solids, const int *which, int count) {
    if (!grow(&tree->leaf, tree->leaves, &tree->leaf_room, sizeof *tree->leaf))
        return -1;
    struct leaf leaf;
    for (int type = 0; type < SOLIDS; type++) {
        leaf.first[type] = tree->hot[type].count;
        for (int i = 0; i < count; i++)
            if ((int)solids[which[i]].type == type && !add_hot(tree, &solids[which[i]]))
                return -1;
        leaf.count[type] = tree->hot[type].count - leaf.first[type];
    }
    tree->leaf[tree->leaves] = leaf;
    return tree->leaves++;
}

bool tree_build(struct tree *tree, enum tree_kind kind, int width, const struct solid_in *solids,
                int count) {
    tree->kind = kind;
    tree->width = width;
    tree->bounds = NOWHERE;
    tree->nodes = tree->kds = tree->leaves = 0;
    for (int type = 0; type < SOLIDS; type++)
        tree->hot[type].count = 0;
    int *which = malloc((size_t)count * sizeof *which + 1);
    if (!which)
        return false;
    for (int i = 0; i < count; i++) {
        which[i] = i;
        tree->bounds = joined(tree->bounds, &solids[i].box);
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
        struct hot *hot = &tree->hot[type];
        for (int f = 0; f < MOST_FIELDS; f++)
            free(hot->field[f]);
        for (int k = 0; k < 3; k++)
            free(hot->reach[k]);
        free(hot->index);
    }
    free(tree->boxes);
    free(tree->child);
    free(tree->kd);
    free(tree->leaf);
}
