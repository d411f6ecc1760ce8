// A packet's march of shadow rays, step by step: what shadow/soft_shadow.c and the marches in batches share.
#ifndef OPT9_UMBRA_H
#define OPT9_UMBRA_H

#include "bvh/bvh_lists.h"

// Of a ray that is from it, a sphere's distance in float is noise in the third digit at first: that of its
// power is not.
__attribute__((always_inline)) static inline vfloat
distance_along(const struct shadow_candidate *near, vfloat t, const struct primitive *s) {
    COUNT(distance_along, call);
    if (s->way == EVAL_LINEAR) {
        COUNT(distance_along, linear);
        return v_madd(t, near->direction.x, near->origin.x);
    }
    if (near->power) {
        COUNT(distance_along, power);
        vfloat power = v_madd(t, t + near->slope, near->constant);
        return power / (v_sqrt(v_max(power + v_splat(s->bound_sq), v_splat(0.0f))) + v_splat(s->a));
    }
    COUNT(distance_along, point);
    struct vec p = vec_along(near->origin, near->direction, t);
    return distance_at(s->repeated ? vec_wrapped(s, p) : p, s, v_mask_none());
}

// One packet's march.
struct shadow_march {
    struct shadow_candidate *nears;
    const struct shape_set *candidates;
    vmask done;
    vfloat t, from, previous, end; // lanes that move take MARCH_REALS from here on with them
    vfloat square, divisor;        // least² = square/divisor; no root or quotient until the end
    vfloat linear, constant;       // t·(t + linear) + constant > 0: out of the bounds
    vmask sole_solid;              // one convex solid alone can bring a term below 1
};
enum { MARCH_REALS = 8 };
_Static_assert(offsetof(struct shadow_march, constant) ==
                   offsetof(struct shadow_march, t) + (MARCH_REALS - 1) * sizeof(vfloat),
               "one behind the other");
enum { LEAP_MIN_MAX_STEPS = 256 }; // with a cap below, every step is taken: none is leapt over

// Where a march begins, and whether it is told dark at once. Of a crowd no casters are listed.
KERNEL_SHARED void begin_march(struct shadow_rays *r, struct shadow_candidate *nears,
                               struct shape_set *casters, const struct tile_context *work,
                               struct shadow_march *m);

// Which of the rays are on no surface, where the nearest shape is at distance h.
static inline vmask off_surfaces(const struct shadow_march *m, vfloat h, vfloat hit_distance) {
    COUNT(off_surfaces, call);
    return v_cmp_nlt_in(v_not(m->done), h, v_max(hit_distance, m->t * v_splat(0x1p-24f)));
}

// On by that distance: those that live.
static inline void advance_by(struct shadow_march *m, vfloat h, vmask live) {
    COUNT(advance_by, call);
    m->previous = h;
    live = v_cmp_ngt_in(live, m->from, m->end); // the step to here began behind it
    m->from = m->t;
    m->t = m->t + v_select_or_zero(live, h);
    live = v_cmp_ngt_in(live, v_madd(m->t, m->t + m->linear, m->constant), v_splat(0.0f));
    m->done = v_not(live);
}

__attribute__((always_inline)) static inline void
shadow_step(struct shadow_march *m, vfloat h, vfloat strength, vfloat hit_distance, float dark) {
    ACTIVE(LANES - v_count(m->done));
    COUNT(shadow_step, call);
    vmask live = off_surfaces(m, h, hit_distance);
    // strength²·(h² − y²) < least²·(t − y)², both sides times (2·previous)², but for a power of 2 that keeps small
    // distances from underflow.
    vfloat twice = m->previous + m->previous, unit = v_pow2_unit(twice);
    vfloat part = h * unit, square = h * h;
    twice = twice * unit;
    vfloat inside = v_msub(twice, twice, part * part), beyond = v_msub(twice, m->t, part * h);
    vmask sound = v_cmp_gt_in(live, inside, twice * twice * v_splat(2e-5f));
    sound = v_cmp_gt_in(sound, beyond, v_splat(0.0f));
    vfloat term = strength * strength * square * inside, divisor = beyond * beyond;
    vmask darker = v_cmp_lt_in(sound, term * m->divisor, m->square * divisor);
    m->square = v_select(darker, term, m->square);
    m->divisor = v_select(darker, divisor, m->divisor);
    if (dark > 0.0f) {
        COUNT(shadow_step, dark);
        live = v_cmp_nlt_in(live, m->square, m->divisor * v_splat(dark));
    }
    advance_by(m, h, live);
}
// March all shadow rays that wait and add their light: of a crowd, where there is a Mandelbulb, of any other scene.
void cast_batches(const struct tile_context *work);
KERNEL_SHARED void cast_streams(const struct tile_context *work);
KERNEL_SHARED void cast_packets(const struct tile_context *work);

#endif
