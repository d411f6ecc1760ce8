// Prepares the scene in the form that the march needs, again whenever it has moved.
#include <string.h>

#include "phase.h"
#include "scene/vector.h"
#include "trace.h"

#include "scene/shape_sizes.h" // needs trace.h

static struct primitive make_primitive(const struct shape *shape) {
    struct primitive p = {.type = shape->type};
    vec_set(shape->position, p.position);
    rotation_matrix(shape->rotation_degrees, p.rotation);
    for (int i = 0; i < 3; i++) {
        p.rotated = p.rotated || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = shape->repeat[i];
        p.inv_cell[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
    }
    set_sizes(shape, &p);
    return p;
}

#define PRIMITIVE_OF(shape) make_primitive(shape)
#include "scene/group_compile.h"

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    prepared->bounds_sq = model->march.bounds_radius * model->march.bounds_radius;
    struct instruction *next = prepared->instructions;
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        prepared->primitives[i] = make_primitive(shape);
        if (shape->type == SHAPE_GROUP)
            next = group_compile(model, shape->group.root, &prepared->primitives[i], next);
    }
    return true;
}
