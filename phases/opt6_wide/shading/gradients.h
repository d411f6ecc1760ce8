// Gradients of the shapes' distances: closed forms, and differences.
#pragma once

#include "simd/simd.h"

#include "core/shape_distances.h"

// A scene defines its normals by forward differences of its distance over normal_step. In float these differences are
// noise in the third digit: an ulp of the point over 1e-4. So the closed form of the shape's gradient is used where
// both agree within that noise. Within a step of an edge they disagree, and the shape's difference is used. Where
// another shape is within reach of the step, the difference of the whole scene is used. The Mandelbulb has only
// differences.
// The results are in the world's axes and need not be of unit length.
static inline struct vec box_gradient(struct vec p, const struct primitive *s) {
    vfloat zero = v_splat(0.0f);
    vfloat x = v_abs(p.x) - v_splat(s->size[0]);
    vfloat y = v_abs(p.y) - v_splat(s->size[1]);
    vfloat z = v_abs(p.z) - v_splat(s->size[2]);
    vfloat most = v_max(x, v_max(y, z));
    // Outside: away from the nearest point. Inside: along the axis of the nearest face.
    vmask outside = v_cmp_gt(most, zero), on_x = v_cmp_ge(x, most), on_y = v_cmp_ge(y, most);
    vfloat one = v_splat(1.0f);
    struct vec face = {v_select_or_zero(on_x, one), v_select_or_zero(v_andnot(on_x, on_y), one),
                       v_zero_where(v_or(on_x, on_y), one)};
    struct vec away = {v_max(x, zero), v_max(y, zero), v_max(z, zero)};
    struct vec g = vec_select(outside, away, face);
    return (struct vec){v_copysign(g.x, p.x), v_copysign(g.y, p.y), v_copysign(g.z, p.z)};
}

static inline struct vec torus_gradient(struct vec p, const struct primitive *s) {
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vfloat outward = v_splat(1.0f) - v_splat(s->a) / v_max(radius, v_splat(1e-30f));
    return (struct vec){p.x * outward, p.y, p.z * outward};
}

static inline struct vec cone_gradient(struct vec p, const struct primitive *s) {
    vfloat zero = v_splat(0.0f);
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vfloat x = radius - v_splat(s->b), y = p.y - v_splat(s->c);
    vfloat rim = v_select(v_cmp_lt(p.y, zero), v_splat(s->a), v_splat(s->b));
    vfloat cap_x = v_max(radius - rim, zero), cap_y = v_abs(p.y) - v_splat(s->c);
    vfloat across =
        v_madd(x, v_splat(s->slope[0]), y * v_splat(s->slope[1])) * v_splat(-s->per_slope_sq);
    vfloat along = v_min(v_max(across, zero), v_splat(1.0f));
    vfloat side_x = v_madd(v_splat(s->slope[0]), along, x);
    vfloat side_y = v_madd(v_splat(s->slope[1]), along, y);
    // Beside the slope, the slope's normal is used: for a point on it, the vector to it is mostly rounding.
    vmask beside = v_and(v_cmp_gt(across, zero), v_cmp_lt(across, v_splat(1.0f)));
    vfloat out = v_select(beside, v_splat(s->slope[1]), side_x),
           up = v_select(beside, v_splat(-s->slope[0]), side_y);
    vmask cap =
        v_cmp_lt(v_madd(cap_x, cap_x, cap_y * cap_y), v_madd(side_x, side_x, side_y * side_y));
    vfloat cap_up =
        v_select(v_cmp_gt(cap_x, zero), cap_y, v_splat(1.0f)); // over the cap: straight up
    out = v_select(cap, cap_x, out);
    up = v_select(cap, v_copysign(cap_up, p.y), up);
    vfloat per_radius = out / v_max(radius, v_splat(1e-30f));
    return (struct vec){p.x * per_radius, up, p.z * per_radius};
}

static inline struct vec octahedron_gradient(struct vec p) {
    vfloat one = v_splat(1.0f);
    return (struct vec){v_copysign(one, p.x), v_copysign(one, p.y), v_copysign(one, p.z)};
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
