// The state of a packet's march. Included by march/march.h, after core/trace.h and march/march_step.h.
#pragma once

// Where the rays of a packet are: at the distance before + t + last. t and the last step are kept apart, because their
// rounded sum would lose the digits that place the hit on the surface.
struct march_state {
    struct point origin; // at the distance `before`
    vfloat before, t, last, evals;
    vfloat start; // t of the next evaluation: core/trace_context.h
    vmask found;
    struct bounds_exit exit;
    int cap, left; // evaluations that a ray may have; steps that every ray still has before that
    vmask deep;    // a ray that started inside a shape has stepped back out of it
    vmask exact;   // the hit is found already, more exactly than land_hits() could (opt8_streams)
    vfloat inside; // the number of the shape that a ray of `deep` was in; else −1
    struct hit_surroundings near;
};

// Returns the state in which the rays of packet k begin.
static inline struct march_state march_state_of(const struct ray_group *rays, int k,
                                                struct trace_context *world) {
    vfloat zero = v_splat(0.0f);
    struct march_state at = {.origin = rays->origin[k], .inside = v_splat(-1.0f)};
    at.before = at.t = at.last = at.evals = zero;
    at.cap = step_cap(&world->scene->model);
    at.start = start_of(rays, k, world, &at.cap);
    at.found = at.deep = at.exact = v_mask_none();
    return at;
}

// Returns t of the next evaluation. A ray that has ended stays where it is.
static inline vfloat first_t(struct march_state *at, vmask live) {
    vfloat t = v_select(live, at->start, at->t);
    at->start = v_splat(0.0f); // of a march that goes on from a hit
    return t;
}

// Returns the hits that may be off their surface: not those that an earlier call has settled.
static inline vmask may_be_off(const struct march_state *at, vmask settled) {
    return v_andnot(v_or(at->exact, v_or(at->deep, settled)), at->found);
}
