// One step of a packet of soft shadow rays: shared by packets (shadow/soft_shadow.c), batches
// (shadow/shadow_batch.c) and streams (shadow/bulb_shadows.c).
#pragma once

#include "shadow/shadow_rays.h"
#include "types/sdf.h"
#include "types/tile_context.h"

// Returns the distance to shape s at t. Near its own sphere a ray's distance in float errs in the third
// digit; the power does not.
__attribute__((always_inline)) static inline vfloat
distance_along(const struct shadow_candidate *candidate, vfloat t, const struct primitive *s) {
    if (s->eval == EVAL_LINEAR)
        return v_madd(t, candidate->direction.x, candidate->origin.x);
    if (candidate->power) {
        vfloat power = v_madd(t, t + candidate->slope, candidate->constant);
        return power / (v_sqrt(v_max(power + v_splat(s->bound_sq), v_splat(0.0f))) + v_splat(s->a));
    }
    struct vec p = vec_along(candidate->origin, candidate->direction, t);
    return distance_at(s->repeated ? vec_wrapped(s, p) : p, s, v_mask_none());
}

// Returns the rays that have not hit a surface, h being the distance to the nearest shape.
static inline vmask off_surfaces(const struct shadow_march *m, vfloat h, vfloat hit_distance) {
    return v_cmp_nlt_in(v_not(m->done), h, v_max(hit_distance, m->t * v_splat(0x1p-24f)));
}

// Moves the `live` rays on by h. Ends the rays outside the bounds, and those whose last step began beyond
// their end.
static inline void advance_by(struct shadow_march *m, vfloat h, vmask live) {
    m->previous = h;
    live = v_cmp_ngt_in(live, m->step_began, m->end); // the step to t began beyond the end
    m->step_began = m->t;
    m->t = m->t + v_select_or_zero(live, h);
    live = v_cmp_ngt_in(live, v_madd(m->t, m->t + m->linear, m->constant), v_splat(0.0f));
    m->done = v_not(live);
}

__attribute__((always_inline)) static inline void
shadow_step(struct shadow_march *m, vfloat h, vfloat strength, vfloat hit_distance, float dark) {
    ACTIVE(LANES - v_count(m->done));
    COUNT(shadow_step, call);
    vmask live = off_surfaces(m, h, hit_distance);
    // Tests strength²·(h² − y²) < least²·(t − y)², both sides times (2·previous)² and a power of 2 that
    // prevents underflow.
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
    if (dark > 0.0f)
        live = v_cmp_nlt_in(live, m->square, m->divisor * v_splat(dark));
    advance_by(m, h, live);
}

// One step of all rays except those in `still`.
static inline void step_others(struct shadow_march *m, vmask still, vfloat h, vfloat strength,
                               vfloat hit) {
    vfloat previous = m->previous, from = m->step_began;
    m->done = still;
    shadow_step(m, h, strength, hit, 0.0f);
    m->previous = v_select(still, previous, m->previous);
    m->step_began = v_select(still, from, m->step_began);
}

// Loads the packet at queue index `first`. Member by member: gcc copies a whole struct twice.
static inline void load_shadow_packet(float field[][QUEUE_ROOM], int first, int count,
                                      struct shadow_rays *r) {
    int left = count - first;
    r->active = v_mask_first(left < 0 ? 0 : left < LANES ? left : LANES);
    r->point = load_vec(field + S_POINT, first);
    r->local = load_vec(field + S_LOCAL, first);
    r->to_light = load_vec(field + S_TO_LIGHT, first);
    r->facing = v_load(&field[S_FACING][first]);
    r->shape = v_load(&field[S_SHAPE][first]);
    r->end = v_splat(0.0f);
    r->leap_limit = v_splat(INFINITY);
    r->on_plane = r->meets_one = r->meets_many = v_mask_none();
    r->first = v_splat(INFINITY);
    r->cosine = v_splat(1.0f);
    r->from_planes = false;
}
