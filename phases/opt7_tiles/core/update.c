// Prepares the scene in the form that the march needs, again whenever it has moved.
#include "core/primitives.h"

#include <stdlib.h>

// Beyond this radius the power-8 map's orbits escape: |w|⁸ − r ≥ 1.9 from |w| = r = 1.15 on. There the estimate is at
// least half of the distance to the ball: tests/phases/test_tiles.py samples it.
#define BALL_RADIUS 1.15f

// A wrapped distance is 1-Lipschitz if the shape is its mirror image at the walls of its cell. A plane or a cone is
// not. A Mandelbox's estimate is not either, and how far it reaches depends on its numbers.
static enum bound_kind bound_kind_of(const struct shape *shape, bool repeated) {
    bool jumps = repeated && (shape->type == SHAPE_PLANE || shape->type == SHAPE_CONE);
    if (jumps || shape->type == SHAPE_MANDELBOX)
        return BOUND_NONE;
    return shape->type == SHAPE_MANDELBULB ? BOUND_BALL : BOUND_LIPSCHITZ;
}

// Sets the members that cones and bundles need.
static void prepare_bounds(struct primitive *p, const struct shape *shape,
                           const struct limits *limits) {
    if (p->type == SHAPE_MANDELBULB)
        p->a = BALL_RADIUS + 2.0f * (float)limits->hit_distance;
    p->trust = bound_kind_of(shape, p->repeated);
    p->error = 0x1p-18f * fmaxf(extent_of(shape), shape->type == SHAPE_PLANE ? fabsf(p->a) : 1.0f);
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    int next = 0, *each = (int *)prepared->all.shape, *order = (int *)prepared->all.order;
    prepared->all.count = model->shape_count;
    prepared->all.steady = 0;
    for (int i = 0; i < model->shape_count; i++)
        each[i] = i;
    for (int i = 0; i < model->shape_count; i++) {
        prepared->primitives[i] = prepare_shape(i, &model->shapes[i], &model->march);
        prepare_bounds(&prepared->primitives[i], &model->shapes[i], &model->march);
    }
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
