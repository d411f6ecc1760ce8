// Prepares the scene in the form that the march needs, again whenever it has moved.
#include <math.h>

#include "phase.h"
#include "scene/vector.h"
#include "trace.h"

#include "scene/shape_sizes.h" // needs trace.h

static void to_floats(const double from[3], float to[3]) {
    for (int i = 0; i < 3; i++)
        to[i] = (float)from[i];
}

// Fills what moves a ray's origin into the shape's frame. A LINEAR plane needs one row only.
static void set_local_frame(struct primitive *p, const struct shape *shape, double rotation[3][3]) {
    bool linear = p->eval == LINEAR;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double *n = shape->plane.normal;
            p->row[i][j] =
                linear ? n[0] * rotation[0][j] + n[1] * rotation[1][j] + n[2] * rotation[2][j]
                       : rotation[i][j];
        }
        p->centre[i] = shape->position[i];
    }
    if (p->eval == POWER) {
        p->radius_sq = shape->sphere.radius * shape->sphere.radius;
        p->sphere.radius_sq = (float)p->radius_sq;
    }
    if (linear) {
        p->offset = shape->plane.offset;
        to_floats(p->row[0], p->normal);
    }
}

// How to evaluate a shape. A sphere wider than the bounds is always nearer than its radius: there its
// power is as exact as a point, and much more exact near the surface. For other spheres a point is
// cheaper, and more exact many radii away. The square of 1e15 still fits a float.
static enum eval_kind eval_kind_of(const struct shape *shape, bool repeated,
                                   const struct limits *limits) {
    if (repeated)
        return AT_POINT;
    if (shape->type == SHAPE_SPHERE && shape->sphere.radius >= limits->bounds_radius &&
        shape->sphere.radius < 1e15)
        return POWER;
    return shape->type == SHAPE_PLANE ? LINEAR : AT_POINT;
}

static struct primitive make_primitive(int index, const struct shape *shape,
                                       const struct limits *limits) {
    struct primitive p = {.type = shape->type, .index = (float)index};
    double rotation[3][3];
    rotation_matrix(shape->rotation_degrees, rotation);
    for (int i = 0; i < 3; i++) {
        split(shape->position[i], &p.position[i], &p.position_lo[i]);
        to_floats(rotation[i], p.rotation[i]);
        p.rotated = p.rotated || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = (float)shape->repeat[i];
        p.cell_double[i] = shape->repeat[i];
        p.inv_cell_double[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
        p.inv_cell[i] = (float)p.inv_cell_double[i];
    }
    p.eval = eval_kind_of(shape, p.repeated, limits);
    set_local_frame(&p, shape, rotation);
    set_sizes(shape, &p);
    return p;
}

#define PRIMITIVE_OF(shape) make_primitive(0, shape, &model->march)
#include "scene/group_compile.h"

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    struct instruction *next = prepared->instructions;
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        prepared->primitives[i] = make_primitive(i, shape, &model->march);
        if (shape->type != SHAPE_GROUP)
            continue;
        next = group_compile(model, shape->group.root, &prepared->primitives[i], next);
        prepared->primitives[i].group.extent = (float)model->nodes[shape->group.root].radius;
    }
    return true;
}
