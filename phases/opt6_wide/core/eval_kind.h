// How a shape is evaluated, and numbers as floats. No lanes in here. Included after scene/scene.h.
#pragma once

#include <stdbool.h>

// Splits a double into the sum of two floats.
static inline void split(double a, float *hi, float *lo) {
    *hi = (float)a;
    *lo = (float)(a - *hi);
}

static inline void to_floats(const double from[3], float to[3]) {
    for (int i = 0; i < 3; i++)
        to[i] = (float)from[i];
}

// How a shape is evaluated along a ray. POINT: its distance at a point of its frame. LINEAR: a line in t, for a plane
// that is not repeated. POWER: its power, a polynomial in t, for a sphere wider than the bounds. FIELD: a group's
// program, at a point of the group's frame.
enum eval_kind { EVAL_POINT, EVAL_LINEAR, EVAL_POWER, EVAL_FIELD };

// Returns how the shape is evaluated. Of a sphere wider than the bounds only a part is seen, from nearer than its
// radius. There its power is as exact as a point, and more exact near the surface. For other spheres a point is
// cheaper, and from many radii away more exact. 1e15: its square is a float.
static inline enum eval_kind eval_kind_of(const struct shape *shape, bool repeated,
                                          const struct limits *limits) {
    if (repeated)
        return EVAL_POINT;
    if (shape->type == SHAPE_SPHERE && shape->sphere.radius >= limits->bounds_radius &&
        shape->sphere.radius < 1e15)
        return EVAL_POWER;
    return shape->type == SHAPE_PLANE ? EVAL_LINEAR : EVAL_POINT;
}
