// What every march asks: where a ray leaves the bounds, how small a step may be, and Newton's last step.
#ifndef MARCHING_H
#define MARCHING_H

#include "core/primitive.h"
#include "simd/simd.h"

// A ray leaves the bounds when |o + t·d|² > radius²: a polynomial in t, free of the point itself, and
// known to a few 2^-24 of radius²: within 2^-20 the ray goes on, and its hit is asked by within().
struct bounds_exit {
    vfloat linear, constant; // t·(t + linear) + constant > 0
};

static inline struct bounds_exit bounds_exit_of(struct point origin, struct vec direction,
                                                const struct model *model) {
    COUNT(bounds_exit_of, call);
    COUNT(bounds_exit_of, scalar);
    float radius = (float)model->march.bounds_radius;
    struct vec o = origin.hi;
    return (struct bounds_exit){v_splat(2.0f) * vec_dot(o, direction),
                                vec_dot(o, o) - v_splat(radius * radius * (1.0f + 0x1p-20f))};
}

// The state of a packet's shadow rays.
struct shadow_state {
    vfloat least_sq; // of the light so far: the root is taken once, of what is left in the end
    vfloat twice_previous;
    struct bounds_exit exit;
};

static inline vfloat outside_of_bounds(struct bounds_exit exit, vfloat t) { // > 0: outside
    return v_madd(t, t + exit.linear, exit.constant);
}

// The hit test that float can keep: below half an ulp of t, 2^-24·t at the most, a step no longer
// moves the ray, and it would stall there until the step cap.
static inline vfloat min_step(vfloat t, vfloat hit_distance) {
    return v_max(hit_distance, t * v_splat(0x1p-24f));
}

// Newton's last step: more than h is left to go where a ray grazes, 33 times on scene0's plane at the
// horizon. Only for what float's march may err by: what a larger hit_distance leaves is the scene's.
static inline vfloat newton(vfloat h, vfloat slope, vfloat path) {
    COUNT(newton, call);
    vmask small = v_cmp_lt(v_abs(h), path * v_splat(0x1p-21f));
    return v_select_or_zero(small, h / v_max(slope, v_splat(0x1p-9f)));
}

// More counts of steps a float cannot hold; a ray that was asked for more ends here as at the cap.
enum { MAX_COUNTED_STEPS = 1 << 24 };

static inline int step_cap(const struct model *model) {
    return model->march.max_steps < MAX_COUNTED_STEPS ? model->march.max_steps : MAX_COUNTED_STEPS;
}

#endif
