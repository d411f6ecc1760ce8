// The shapes as the march wants them, anew whenever the scene has moved.
#include "core/primitives.h"

#include <stdlib.h>

// Beyond it the power-8 map's orbits escape (|w|⁸ − r ≥ 1.9 from |w| = r = 1.15 on), and its estimate is at least half
// of the distance to that ball: tests/py/test_tiles.py samples it.
#define BALL_RADIUS 1.15f

// A wrapped distance is a distance where the shape is the mirror image of itself at its cell's walls.
static enum bound_kind bound_kind_of(const struct shape *shape, bool repeated) {
    if (repeated && (shape->type == SHAPE_PLANE || shape->type == SHAPE_CONE))
        return BOUND_NONE;
    return shape->type == SHAPE_MANDELBULB ? BOUND_BALL : BOUND_LIPSCHITZ;
}

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
        p.a = BALL_RADIUS + 2.0f * (float)limits->hit_distance;
        p.bailout = (float)shape->mandelbulb.bailout;
        p.iterations = shape->mandelbulb.iterations;
        break;
    }
    p.steady = !p.repeated && p.type != SHAPE_MANDELBULB;
    p.trust = bound_kind_of(shape, p.repeated);
    p.error = 0x1p-18f * fmaxf(extent_of(shape), shape->type == SHAPE_PLANE ? fabsf(p.a) : 1.0f);
    p.slack = 0x1p-18f * extent_of(shape);
    return p;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    int next = 0, *each = (int *)prepared->all.shape, *order = (int *)prepared->all.order;
    prepared->all.count = model->shape_count;
    prepared->all.steady = 0;
    for (int i = 0; i < model->shape_count; i++)
        each[i] = i;
    for (int i = 0; i < model->shape_count; i++)
        prepared->placed[i] = prepare_shape(i, &model->shapes[i], &model->march);
    for (int steady = 1; steady >= 0; steady--)
        for (int type = 0; type < SHAPE_TYPES; type++)
            for (int i = 0; i < model->shape_count; i++)
                if (prepared->placed[i].steady == steady && (int)prepared->placed[i].type == type) {
                    order[next++] = i;
                    prepared->all.steady += steady;
                }
    return true;
}

bool shapes_reserve(struct prepared *prepared, const struct model *model) {
    prepared->placed = calloc((size_t)model->shape_count, sizeof *prepared->placed);
    int *both = calloc((size_t)model->shape_count, 2 * sizeof *both);
    prepared->all.shape = both;
    prepared->all.order = both ? both + model->shape_count : NULL;
    return prepared->placed && both;
}

void shapes_release(struct prepared *prepared) {
    free(prepared->placed);
    free((void *)prepared->all.shape); // and order
}
