// The list of all shapes, and the memory of the shapes.
#include "core/primitives.h"
#include "groups/program.h"

#include <stdlib.h>

void list_shapes(struct prepared *prepared) {
    int count = prepared->model.shape_count, next = 0;
    int *each = (int *)prepared->all.shape, *order = (int *)prepared->all.order;
    prepared->all.count = count;
    prepared->all.steady = 0;
    for (int i = 0; i < count; i++)
        each[i] = i;
    for (int steady = 1; steady >= 0; steady--)
        for (int type = 0; type < SHAPE_TYPES; type++)
            for (int i = 0; i < count; i++)
                if (prepared->primitives[i].steady == steady &&
                    (int)prepared->primitives[i].type == type) {
                    order[next++] = i;
                    prepared->all.steady += steady;
                }
}

bool shapes_reserve(struct prepared *prepared, const struct model *model) {
    prepared->primitives = calloc((size_t)model->shape_count, sizeof *prepared->primitives);
    int *both = calloc((size_t)model->shape_count, 2 * sizeof *both);
    prepared->all.shape = both;
    prepared->all.order = both ? both + model->shape_count : NULL;
    prepared->groups = groups_reserve(model);
    return prepared->primitives && both && (prepared->groups || model->node_count == 0);
}

void shapes_release(struct prepared *prepared) {
    free(prepared->groups);
    free(prepared->primitives);
    free((void *)prepared->all.shape); // frees `order` too: one block of memory
}
