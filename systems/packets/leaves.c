// The tree's leaves: arrays of the solids that rays are tested against.
#include "builders.h"

static const int FIELDS[SOLIDS] = {4, 15, 15};

// Makes room for one more solid in all arrays of a type. They end MAX_LANES behind the last solid,
// since a vector may be loaded there.
static bool grow_arrays(struct solid_arrays *arrays, int type) {
    if (arrays->count + MAX_LANES < arrays->room)
        return true;
    int room = arrays->room ? 2 * arrays->room : 4 * MAX_LANES;
    float **array[MAX_FIELDS + 4];
    int count = 0;
    for (int f = 0; f < FIELDS[type]; f++)
        array[count++] = &arrays->field[f];
    for (int k = 0; k < 3; k++)
        array[count++] = &arrays->reach[k];
    array[count++] = &arrays->index;
    for (int i = 0; i < count; i++) {
        float *made = realloc(*array[i], (size_t)room * sizeof(float));
        if (!made)
            return false;
        memset(made + arrays->room, 0, (size_t)(room - arrays->room) * sizeof(float));
        *array[i] = made;
    }
    arrays->room = room;
    return true;
}

static bool add_solid(struct tree *tree, const struct bounded_solid *s) {
    struct solid_arrays *arrays = &tree->arrays[s->type];
    if (!grow_arrays(arrays, (int)s->type))
        return false;
    int at = arrays->count++;
    for (int f = 0; f < FIELDS[s->type]; f++)
        arrays->field[f][at] = s->field[f];
    for (int k = 0; k < 3; k++)
        arrays->reach[k][at] =
            float_max(s->box.hi[k] - s->field[F_CENTRE + k], s->field[F_CENTRE + k] - s->box.lo[k]);
    arrays->index[at] = (float)s->index;
    return true;
}

int add_leaf(struct tree *tree, const struct bounded_solid *solids, const int *which, int count) {
    if (!reserve_one(&tree->leaf, tree->leaves, &tree->leaf_room, sizeof *tree->leaf))
        return -1;
    struct leaf leaf;
    for (int type = 0; type < SOLIDS; type++) {
        leaf.first[type] = tree->arrays[type].count;
        for (int i = 0; i < count; i++)
            if ((int)solids[which[i]].type == type && !add_solid(tree, &solids[which[i]]))
                return -1;
        leaf.count[type] = tree->arrays[type].count - leaf.first[type];
    }
    tree->leaf[tree->leaves] = leaf;
    return tree->leaves++;
}
