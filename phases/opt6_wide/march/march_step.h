// What every march needs: where a ray leaves the bounds, how small a step may be, and Newton's last step.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

// Where a ray leaves the bounds: |o + t·d|² > radius², a polynomial in t. Its error is a few 2^-24 of radius², so a
// ray within 2^-20 goes on, and within() decides on its hit.
struct bounds_exit {
    vfloat linear, constant; // t·(t + linear) + constant > 0
};

static inline struct bounds_exit bounds_exit_of(struct point origin, struct vec direction,
                                                const struct model *model) {
    float radius = (float)model->march.bounds_radius;
    struct vec o = origin.hi;
    return (struct bounds_exit){v_splat(2.0f) * vec_dot(o, direction),
                                vec_dot(o, o) - v_splat(radius * radius * (1.0f + 0x1p-20f))};
}

// The state of a packet's shadow rays.
struct shadow_state {
    vfloat least_sq;       // squared light that is left; the root is taken once, at the end
    vfloat twice_previous; // twice the distance at the step before
    struct bounds_exit exit;
};

static inline vfloat outside_of_bounds(struct bounds_exit exit, vfloat t) { // > 0: outside
    return v_madd(t, t + exit.linear, exit.constant);
}

// Returns the smallest step. A step below half an ulp of t, at most 2^-24·t, no longer moves the ray, which would
// stall there until the step cap.
static inline vfloat min_step(vfloat t, vfloat hit_distance) {
    return v_max(hit_distance, t * v_splat(0x1p-24f));
}

// Returns Newton's last step. Where a ray grazes, more than h is left to go: 33 h on scene0's plane at the horizon. It
// corrects only the error of a march in float, 2^-21 of the path: what a larger hit_distance leaves is part of the
// scene's picture.
static inline vfloat newton(vfloat h, vfloat slope, vfloat path) {
    vmask small = v_cmp_lt(v_abs(h), path * v_splat(0x1p-21f));
    return v_select_or_zero(small, h / v_max(slope, v_splat(0x1p-9f)));
}

// Floats count whole steps up to this. A ray with a larger cap ends here as at its cap.
enum { MAX_COUNTED_STEPS = 1 << 24 };

static inline int step_cap(const struct model *model) {
    return model->march.max_steps < MAX_COUNTED_STEPS ? model->march.max_steps : MAX_COUNTED_STEPS;
}
