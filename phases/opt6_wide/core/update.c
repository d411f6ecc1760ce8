// Prepares the scene in the form that the march needs, again whenever it has moved.
#include "core/primitives.h"
#include "groups/program.h"
#include "phase.h"

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    for (int i = 0; i < model->shape_count; i++)
        prepared->primitives[i] = prepare_shape(i, &model->shapes[i], &model->march);
    compile_groups(prepared);
    list_shapes(prepared);
    return true;
}
