// Gradients of the shapes' distances: closed forms, and differences.
#pragma once

#include "simd/simd.h"

#include "core/shape_distances.h"
#include "packet/gradients.h"

// A scene defines its normals by forward differences of its distance over normal_step. In float these differences are
// noise in the third digit: an ulp of the point over 1e-4. So the closed form of the shape's gradient is used where
// both agree within that noise. Within a step of an edge they disagree, and the shape's difference is used. Where
// another shape is within reach of the step, the difference of the whole scene is used. The Mandelbulb has only
// differences.

// Returns the gradient in the shape's axes: of a sphere, and of a shape that has none in closed form, p.
static inline struct vec gradient_in_axes(struct vec p, const struct primitive *s) {
    switch (s->type) {
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX: return box_gradient(p, s->size);
    case SHAPE_TORUS: return torus_gradient(p, s->a);
    case SHAPE_CONE: return cone_gradient(p, s->a, s->b, s->c, s->slope, s->per_slope_sq);
    case SHAPE_OCTAHEDRON: return octahedron_gradient(p);
    case SHAPE_PLANE: return vec_set(s->size);
    default: return p;
    }
}

// Returns the hit in the frame of one shape, moved by `step` along an axis of the world, which is a column of the
// shape's matrix. Axis −1: not moved.
static inline struct vec moved_in(const struct primitive *primitive, const struct local_ray *local,
                                  float step, int axis) {
    struct vec p = local->origin;
    if (axis < 0)
        return p;
    p = (struct vec){p.x + v_splat(step * primitive->turn[0][axis]),
                     p.y + v_splat(step * primitive->turn[1][axis]),
                     p.z + v_splat(step * primitive->turn[2][axis])};
    return primitive->repeated ? vec_wrapped(primitive, p) : p;
}

static inline vfloat moved_power(const struct primitive *primitive, const struct local_ray *local,
                                 float step, int axis) {
    if (axis < 0)
        return local->power;
    struct vec column = {v_splat(primitive->turn[0][axis]), v_splat(primitive->turn[1][axis]),
                         v_splat(primitive->turn[2][axis])};
    return v_madd(v_splat(step),
                  v_madd(v_splat(2.0f), vec_dot(local->origin, column), v_splat(step)),
                  local->power);
}

static inline vfloat moved_distance(const struct primitive *primitive,
                                    const struct local_ray *local, vmask live, float step,
                                    int axis) {
    if (primitive->eval == EVAL_POWER)
        return sdf_power(moved_power(primitive, local, step, axis), primitive);
    if (primitive->eval == EVAL_LINEAR) {
        if (axis < 0)
            return local->origin.x;
        return v_madd(v_splat(primitive->normal[axis]), v_splat(step), local->origin.x);
    }
    struct vec p = moved_in(primitive, local, step, axis);
    if (primitive->eval == EVAL_FIELD)
        return field_at(local, v_splat(0.0f), p, primitive, live);
    return distance_of_type(p, primitive, primitive->type, live);
}

static inline struct vec difference(const struct primitive *primitive,
                                    const struct local_ray *local, vmask live, float step) {
    vfloat f[4];
    for (int axis = -1; axis < 3; axis++)
        f[axis + 1] = moved_distance(primitive, local, live, step, axis);
    return (struct vec){f[1] - f[0], f[2] - f[0], f[3] - f[0]};
}
