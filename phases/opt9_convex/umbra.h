// A packet's march of shadow rays, step by step: what umbra.c and beam.c share.
#ifndef OPT9_UMBRA_H
#define OPT9_UMBRA_H

#include "crowd.h"

// Of a ray that is from it, a sphere's distance in float is noise in the third digit at first: that of its
// power is not.
__attribute__((always_inline)) static inline real distance_along(const struct near *near, real t,
                                                                 const struct placed *s) {
    COUNT(distance_along, call);
    if (s->way == LINEAR) {
        COUNT(distance_along, linear);
        return mul_add(t, near->direction.x, near->origin.x);
    }
    if (near->power) {
        COUNT(distance_along, power);
        real power = mul_add(t, t + near->slope, near->constant);
        return power / (root(most_of(power + set(s->bound_sq), set(0.0f))) + set(s->a));
    }
    COUNT(distance_along, point);
    struct vec p = vec_along(near->origin, near->direction, t);
    return distance_at(s->repeated ? vec_wrapped(s, p) : p, s, no_lane());
}

// One packet's march.
struct march {
    struct near *nears;
    const struct shapes *casters;
    mask done;
    real t, from, previous, end; // lanes that move take MARCH_REALS from here on with them
    real square, divisor;        // least² = square/divisor; no root or quotient until the end
    real linear, constant;       // t·(t + linear) + constant > 0: out of the bounds
    mask one;                    // one convex solid alone can bring a term below 1
};
enum { MARCH_REALS = 8 };
_Static_assert(offsetof(struct march, constant) ==
                   offsetof(struct march, t) + (MARCH_REALS - 1) * sizeof(real),
               "one behind the other");
enum { MANY_STEPS = 256 }; // with a cap below, every step is taken: none is leapt over

// Where a march begins, and whether it is told dark at once. Of a crowd no casters are listed.
SHARED void begin(struct rays *r, struct near *nears, struct shapes *casters,
                  const struct convex *work, struct march *m);

// Which of the rays are on no surface, where the nearest shape is at distance h.
static inline mask on_none(const struct march *m, real h, real hit_distance) {
    COUNT(on_none, call);
    return but_less(not_in(m->done), h, most_of(hit_distance, m->t * set(0x1p-24f)));
}

// On by that distance: those that live.
static inline void go_on_by(struct march *m, real h, mask live) {
    COUNT(go_on_by, call);
    m->previous = h;
    live = but_greater(live, m->from, m->end); // the step to here began behind it
    m->from = m->t;
    m->t = m->t + keep(live, h);
    live = but_greater(live, mul_add(m->t, m->t + m->linear, m->constant), set(0.0f));
    m->done = not_in(live);
}

__attribute__((always_inline)) static inline void step(struct march *m, real h, real strength,
                                                       real hit_distance, float dark) {
    ACTIVE(LANES - count_of(m->done));
    COUNT(step, call);
    mask live = on_none(m, h, hit_distance);
    // strength²·(h² − y²) < least²·(t − y)², both sides times (2·previous)², but for a power of 2 that keeps small
    // distances from underflow.
    real twice = m->previous + m->previous, unit = power_per(twice);
    real part = h * unit, square = h * h;
    twice = twice * unit;
    real inside = mul_sub(twice, twice, part * part), beyond = mul_sub(twice, m->t, part * h);
    mask sound = greater_in(live, inside, twice * twice * set(2e-5f));
    sound = greater_in(sound, beyond, set(0.0f));
    real term = strength * strength * square * inside, divisor = beyond * beyond;
    mask darker = less_in(sound, term * m->divisor, m->square * divisor);
    m->square = choose(darker, term, m->square);
    m->divisor = choose(darker, divisor, m->divisor);
    if (dark > 0.0f) {
        COUNT(step, dark);
        live = but_less(live, m->square, m->divisor * set(dark));
    }
    go_on_by(m, h, live);
}
// March all shadow rays that wait and add their light: of a crowd, where there is a Mandelbulb, of any other scene.
void cast_crowd(const struct convex *work);
SHARED void cast_streams(const struct convex *work);
SHARED void cast_packets(const struct convex *work);

#endif
