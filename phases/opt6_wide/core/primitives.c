// The shapes as the march wants them, anew whenever the scene has moved.
#include "core/primitives.h"

#include <stdlib.h>

static struct primitive prepare_shape(int index, const struct shape *shape,
                                      const struct limits *limits) {
    struct primitive p = {.type = shape->type, .index = (float)index};
    double turn[3][3];
    rotation_matrix(shape->rotation_degrees, turn);
    for (int i = 0; i < 3; i++) {
        split(shape->position[i], &p.position[i], &p.position_lo[i]);
        to_floats(turn[i], p.turn[i]);
        p.turned = p.turned || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = (float)shape->repeat[i];
        p.wide_cell[i] = shape->repeat[i];
        p.wide_per_cell[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
        p.per_cell[i] = (float)p.wide_per_cell[i];
    }
    p.way = eval_kind_of(shape, p.repeated, limits);
    prepare_rows(&p, shape, turn);
    switch (shape->type) {
    case SHAPE_SPHERE: p.a = (float)shape->sphere.radius; break;
    case SHAPE_BOX: to_floats(shape->box.half_size, p.size); break;
    case SHAPE_ROUNDED_BOX:
        to_floats(shape->box.half_size, p.size);
        p.a = (float)shape->box.rounding;
        break;
    case SHAPE_TORUS:
        p.a = (float)shape->torus.major_radius;
        p.b = (float)shape->torus.minor_radius;
        break;
    case SHAPE_CONE: {
        double across = shape->cone.top_radius - shape->cone.bottom_radius;
        double up = 2.0 * shape->cone.half_height;
        p.a = (float)shape->cone.bottom_radius;
        p.b = (float)shape->cone.top_radius;
        p.c = (float)shape->cone.half_height;
        p.slope[0] = (float)across;
        p.slope[1] = (float)up;
        p.per_slope_sq = (float)(1.0 / (across * across + up * up));
        break;
    }
    case SHAPE_OCTAHEDRON: p.a = (float)shape->octahedron.radius; break;
    case SHAPE_PLANE:
        to_floats(shape->plane.normal, p.size);
        p.a = (float)shape->plane.offset;
        break;
    default:
        p.bailout = (float)shape->mandelbulb.bailout;
        p.iterations = shape->mandelbulb.iterations;
        break;
    }
    p.steady = !p.repeated && p.type != SHAPE_MANDELBULB;
    p.slack = 0x1p-18f * extent_of(shape);
    return p;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    int next = 0;
    prepared->steady_count = 0;
    for (int i = 0; i < model->shape_count; i++)
        prepared->placed[i] = prepare_shape(i, &model->shapes[i], &model->march);
    for (int steady = 1; steady >= 0; steady--)
        for (int type = 0; type < SHAPE_TYPES; type++)
            for (int i = 0; i < model->shape_count; i++)
                if (prepared->placed[i].steady == steady && (int)prepared->placed[i].type == type) {
                    prepared->order[next++] = i;
                    prepared->steady_count += steady;
                }
    return true;
}

bool shapes_reserve(struct prepared *prepared, const struct model *model) {
    prepared->placed = calloc((size_t)model->shape_count, sizeof *prepared->placed);
    prepared->order = calloc((size_t)model->shape_count, sizeof *prepared->order);
    return prepared->placed && prepared->order;
}

void shapes_release(struct prepared *prepared) {
    free(prepared->placed);
    free(prepared->order);
}
