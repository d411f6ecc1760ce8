// A step towards a plane. Along its normal the distance is linear in t, so a step is one multiply-add.
#pragma once

#include "march/march_step.h"

// A packet of rays, by their distance from the plane: `origin` at t = 0, and `direction` per unit of t.
struct plane_ray {
    vfloat origin, direction, t;
    struct bounds_exit exit;
    vmask live;
};

// The outcome of a step.
struct step_result {
    vfloat distance;
    vmask going, inside;
};

static inline struct step_result step_to_plane(struct plane_ray *line, vfloat hit_distance) {
    ACTIVE(v_count(line->live));
    COUNT(step_to_plane, call);
    vfloat distance = v_madd(line->t, line->direction, line->origin);
    vmask going = v_cmp_nlt_in(line->live, distance, min_step(line->t, hit_distance));
    line->t = v_add_where(going, line->t, distance);
    vmask inside = v_cmp_ngt_in(going, outside_of_bounds(line->exit, line->t), v_splat(0.0f));
    return (struct step_result){distance, going, inside};
}
