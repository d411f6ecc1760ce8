// Prepares the scene in the form that the march needs, again whenever it has moved.
#include "core/primitives.h"

#include <stdlib.h>

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    int next = 0, *each = (int *)prepared->all.shape, *order = (int *)prepared->all.order;
    prepared->all.count = model->shape_count;
    prepared->all.steady = 0;
    for (int i = 0; i < model->shape_count; i++)
        each[i] = i;
    for (int i = 0; i < model->shape_count; i++)
        prepared->primitives[i] = prepare_shape(i, &model->shapes[i], &model->march);
    for (int steady = 1; steady >= 0; steady--)
        for (int type = 0; type < SHAPE_TYPES; type++)
            for (int i = 0; i < model->shape_count; i++)
                if (prepared->primitives[i].steady == steady &&
                    (int)prepared->primitives[i].type == type) {
                    order[next++] = i;
                    prepared->all.steady += steady;
                }
    return true;
}

bool shapes_reserve(struct prepared *prepared, const struct model *model) {
    prepared->primitives = calloc((size_t)model->shape_count, sizeof *prepared->primitives);
    int *both = calloc((size_t)model->shape_count, 2 * sizeof *both);
    prepared->all.shape = both;
    prepared->all.order = both ? both + model->shape_count : NULL;
    return prepared->primitives && both;
}

void shapes_release(struct prepared *prepared) {
    free(prepared->primitives);
    free((void *)prepared->all.shape); // frees `order` too: one block of memory
}
