// What cones and bundles need of a shape.
#pragma once

#include "core/primitives.h"

// Beyond this radius the power-8 map's orbits escape: |w|⁸ − r ≥ 1.9 from |w| = r = 1.15 on. There the estimate is at
// least half of the distance to the ball: tests/phases/test_tiles.py samples it.
#define BALL_RADIUS 1.15f

// A wrapped distance is 1-Lipschitz if the shape is its mirror image at the walls of its cell. A plane or a cone is
// not. A Mandelbox's estimate is not either, and how far it reaches depends on its numbers.
static inline enum bound_kind bound_kind_of(const struct shape *shape, bool repeated) {
    bool jumps = repeated && (shape->type == SHAPE_PLANE || shape->type == SHAPE_CONE);
    if (jumps || shape->type == SHAPE_MANDELBOX)
        return BOUND_NONE;
    return shape->type == SHAPE_MANDELBULB ? BOUND_BALL : BOUND_LIPSCHITZ;
}

// Sets the members that cones and bundles need.
static inline void prepare_bounds(struct primitive *p, const struct shape *shape,
                                  const struct limits *limits) {
    if (p->type == SHAPE_MANDELBULB)
        p->a = BALL_RADIUS + 2.0f * (float)limits->hit_distance;
    p->trust = bound_kind_of(shape, p->repeated);
    p->error = 0x1p-18f * fmaxf(extent_of(shape), shape->type == SHAPE_PLANE ? fabsf(p->a) : 1.0f);
}

static inline void prepare_group_bounds(struct primitive *p) {
    if (p->eval != EVAL_FIELD)
        return;
    p->trust = p->steady ? BOUND_LIPSCHITZ : BOUND_NONE;
    p->error = fmaxf(p->slack, 0x1p-18f);
}
