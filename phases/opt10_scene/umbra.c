// Marches of shadow rays by the least distance to the shapes that can be the nearest (casters.c): the improved soft
// shadow of I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/rmshadows), after S. Aaltonen's
// GDC 2018 talk. From a plane the first steps are leapt over.
#include "umbra.h"

#include <string.h>

// A distance falls no faster than t grows: what was h at t wakes where h + t is no more than the nearest shape's
// distance + t. 2^-18: of rounding. Before `from` a shape sleeps in any case.
__attribute__((always_inline)) static inline void
near_to(int i, struct near *nears, real t, mask done, const struct prepared *scene, real *least) {
    struct near *near = &nears[i];
    if (scene->placed[i].way == LINEAR) { // cheaper than to ask whether it sleeps
        COUNT(nearest, plane);
        *least = least_of(*least, mul_add(t, near->direction.x, near->origin.x));
        return;
    }
    COUNT(nearest, shape);
    mask awake = both(not_less(*least + t, near->wakes), not_less(t, near->from));
    if (!any(but_not(done, awake)))
        return;
    COUNT(nearest, awake);
    real h = distance_along(near, t, &scene->placed[i]);
    near->wakes = (h + t) * set(1.0f - 0x1p-18f);
    *least = least_of(*least, h);
}

__attribute__((always_inline)) static inline real nearest(struct near *nears,
                                                          const struct shapes *casters, real t,
                                                          mask done, const struct prepared *scene) {
    ACTIVE(LANES - count_of(done));
    COUNT(nearest, call);
    real least = set(INFINITY);
    EACH_IN(*casters, near_to, nears, t, done, KNOWN(scene), &least);
    return least;
}

// From a plane the march's steps are a geometric row until something else is nearer: t₀·(1 + facing)^m. Its
// first term is strength·facing, all others are the same; least²: of those leapt over.
#define STEEP 0.5f
static inline real leap(const struct rays *r, const struct prepared *scene, real start,
                        real strength, real hit_distance, real *previous, real *square) {
    COUNT(leap, call);
    real one = set(1.0f), until = least_of(r->alone, r->end) * set(1.0f - 1e-5f);
    mask can = both(both(r->on_plane, r->active), not_less(until, start));
    // A march that is within the hit distance at its first step has no term at all.
    can = both(can, not_less(start * r->facing, hit_distance));
    if (!any(can))
        return start;
    ACTIVE(count_of(can));
    COUNT(leap, asked);
    COUNT(leap, scalar);
    real c = r->facing;
    if (!any(both(can, less(c, set(STEEP > scene->lit_slope ? STEEP : scene->lit_slope))))) {
        // As towards a high light: no term of these steps is below 1, and they are few.
        COUNT(leap, steep);
        real t = start, before = start, grown = one + c;
        for (mask on = can; any(on); on = both(on, not_less(until, t))) {
            COUNT(leap, step);
            before = choose(on, t, before);
            t = choose(on, t * grown, t);
        }
        *previous = choose(can, before * c, *previous);
        return t;
    }
    COUNT(leap, can);
    real grow = log_of(one + c);
    real steps = floor_of(log_of(most_of(least_of(until, set(1e30f)), start) / start) / grow) + one;
    real t = start * exp_of(steps * grow), first = strength * c, ratio = set(0.5f) * (one + c);
    real inside = neg_mul_add(ratio, ratio, one), beyond = neg_mul_add(c, ratio, one);
    real others = first * first * inside / (beyond * beyond);
    real least = least_of(first * first, choose(greater(steps, set(1.5f)), others, one));
    *square = choose(can, least_of(*square, least), *square);
    *previous = choose(can, t * c / (one + c), *previous);
    return choose(can, t, start);
}

SHARED void begin(struct rays *r, struct near *nears, struct shapes *casters,
                  const struct convex *work, struct march *m) {
    const struct model *model = &KNOWN(work->scene)->model;
    *m = (struct march){.nears = nears,
                        .casters = casters,
                        .previous = set(1e9f),
                        .from = set(0.0f),
                        .divisor = set(1.0f)};
    COUNT(begin, call);
    COUNT(begin, scalar);
    r->sharp = set(8 * SHARP * (float)work->scene->model.march.hit_distance);
    if (IS_CROWD(work->scene))
        crowd_ahead(r, nears, work);
    else
        choose_shapes(r, nears, casters, work);
    m->end = KNOWN(work->scene)->bulbs ? set(INFINITY)
                                       : r->end; // with a Mandelbulb see behind_all() and over()
    // Met at a slant: the march comes to it by steps that fall to 1 − cosine of the one before, so that the last
    // term is below strength·hit_distance/((1 − cosine)·t): at most 1e-4 here, and 0 is written for it. If it has the
    // steps to come there (e^-23 is 1e-10), and takes the first. Those before it is near the surface are not told: a low
    // cap may end it on the way.
    real room = r->first * (set(1.0f) - r->cosine);
    const struct limits *march = &work->scene->model.march;
    float least_room = (float)(1e4 * march->hit_distance * model->shadow_strength);
    real offset = set((float)model->march.surface_offset), hit = set((float)march->hit_distance);
    mask dark = both(both(r->active, greater(room, set(least_room))), less(r->first, r->end));
    float least_cosine = march->max_steps < MANY_STEPS ? INFINITY : 23.0f / (float)march->max_steps;
    dark =
        both(dark, both(greater(r->cosine, set(least_cosine)), not_less(r->facing * offset, hit)));
    m->done = either(dark, not_in(r->active));
    m->square = drop(dark, set(1.0f));
    real strength = set((float)model->shadow_strength);
    m->t = offset;
    if (march->max_steps >= MANY_STEPS)
        m->t = leap(r, KNOWN(work->scene), offset, strength, hit, &m->previous, &m->square);
    m->one = no_lane();
    if (r->floor && !KNOWN(work->scene)->bulbs &&
        !KNOWN(work->scene)->repeats) { // copies may come nearer again
        COUNT(begin, floor);
        m->one = but_not(either(r->many, less(r->facing, set(KNOWN(work->scene)->lit_slope))),
                         r->active);
    }
    float radius = (float)model->march.bounds_radius;
    m->linear = set(2.0f) * vec_dot(r->point, r->to_light);
    m->constant = vec_dot(r->point, r->point) - set(radius * radius * (1.0f + 0x1p-20f));
}

INLINE void near_bulbs(int i, const struct march *m, const mask *done, bool leaving,
                       const struct prepared *scene, real *h) {
    const struct placed *s = &scene->placed[i];
    COUNT(nearest_bulbs, shape);
    real own[ABREAST];
    if (s->type == SHAPE_MANDELBULB) {
        COUNT(nearest_bulbs, bulb);
        struct vec p[ABREAST];
        for (int k = 0; k < ABREAST; k++)
            p[k] = vec_along(m[k].nears[i].origin, m[k].nears[i].direction, m[k].t);
        bulbs(s, p, done, leaving, false, own);
    } else
        for (int k = 0; k < ABREAST; k++)
            own[k] = distance_along(&m[k].nears[i], m[k].t, s);
    for (int k = 0; k < ABREAST; k++)
        h[k] = least_of(h[k], own[k]);
}

// Of all shapes: a Mandelbulb's estimates for several packets fill each other's gaps.
__attribute__((always_inline)) static inline void
nearest_bulbs(const struct march *m, const struct prepared *scene, bool leaving, real *h) {
    COUNT(nearest_bulbs, call);
    mask done[ABREAST];
    for (int k = 0; k < ABREAST; k++) {
        h[k] = set(INFINITY);
        done[k] = m[k].done;
    }
    EACH_SHAPE(scene, near_bulbs, m, done, leaving, KNOWN(scene), h);
}

INLINE void put_behind(int i, const struct march *m, real q, const struct prepared *scene,
                       mask *behind) {
    const struct placed *s = &scene->placed[i];
    const struct near *near = &m->nears[i];
    if (!any(*behind))
        return;
    if (s->way == LINEAR) {
        COUNT(behind_all, plane);
        *behind = both(*behind, not_less(near->direction.x, q));
        return;
    }
    COUNT(behind_all, solid);
    real share = set(s->type == SHAPE_MANDELBULB ? BULB_SHARE : 1.0f);
    struct vec p = vec_along(near->origin, near->direction, m->t);
    real square = vec_dot(p, p), per = inverse_root(most_of(square, set(1e-30f)));
    mask away = not_less(share * vec_dot(p, near->direction) * per, q);
    mask far = not_less(share * (square * per - set(s->bound)), q * m->t);
    *behind = both(*behind, both(away, far));
}

// Rays whose later terms cannot come below what they have: from here on every shape is at q·t or further, for the
// slope q at which no term is less than 0.866·strength·q.
static inline mask behind_all(const struct march *m, float per_strength,
                              const struct prepared *scene) {
    ACTIVE(LANES - count_of(m->done));
    COUNT(behind_all, call);
    COUNT(behind_all, scalar);
    real q = root(m->square / m->divisor) * set(per_strength / 0.866f);
    mask behind = not_in(m->done);
    EACH_SHAPE(scene, put_behind, m, q, KNOWN(scene), &behind);
    return behind;
}

static struct rays waiting(float field[][QUEUE_ROOM], int first, int count) {
    COUNT(waiting, call);
    int left = count - first;
    return (struct rays){.active = first_lanes(left < 0       ? 0
                                               : left < LANES ? left
                                                              : LANES),
                         .point = load_vec(field + S_POINT, first),
                         .local = load_vec(field + S_LOCAL, first),
                         .to_light = load_vec(field + S_TO_LIGHT, first),
                         .facing = load(&field[S_FACING][first]),
                         .shape = load(&field[S_SHAPE][first]),
                         .end = set(0.0f),
                         .alone = set(INFINITY),
                         .on_plane = no_lane(),
                         .some = no_lane(),
                         .many = no_lane(),
                         .first = set(INFINITY),
                         .cosine = set(1.0f)};
}

static void add_lane(int i, float lit, struct desk *desk) {
    COUNT(add_lane, call);
    float (*field)[QUEUE_ROOM] = desk->shadow;
    int pixel = (int)field[S_PIXEL][i];
    for (int k = 0; k < 3; k++)
        desk->color[k * COLOR_ROOM + pixel] += lit * field[S_LIGHT + k][i];
}

// A packet whose lanes hold rays of different age.
struct pool {
    struct march march;
    struct near *nears;
    float ray[LANES];  // which of the queue
    float born[LANES]; // in steps of all; of rays that leave: their own so far, below 0
    unsigned live, leaving;
};

// The first so many of the bits set.
static inline unsigned first_bits(unsigned bits, int count) {
    unsigned rest = bits;
    for (int i = 0; i < count; i++)
        rest &= rest - 1;
    return bits & ~rest;
}

// The first lanes of `here` go on in those of `there`, as many as both have. Which were moved. Of what a shape is to a
// ray: a height and a slope, or a place and a direction (beside Mandelbulbs no sphere has `power`).
static unsigned move_rays(struct pool *to, unsigned there, const struct pool *from, unsigned here,
                          const struct prepared *scene) {
    COUNT(move_rays, call);
    int a = __builtin_popcount(there), b = __builtin_popcount(here);
    there = first_bits(there, a < b ? a : b);
    here = first_bits(here, a < b ? a : b);
    move_lanes((float *)&to->march.t, there, (const float *)&from->march.t, here, MARCH_REALS);
    for (int k = 0; k < KNOWN(scene)->model.shape_count; k++) {
        float *row = (float *)&to->nears[k].origin;
        const float *old = (const float *)&from->nears[k].origin;
        bool linear = KNOWN(scene)->placed[k].way == LINEAR;
        move_lanes(row, there, old, here, linear ? 1 : 6);
        if (linear)
            move_lanes(row + 3 * LANES, there, old + 3 * LANES, here, 1);
    }
    move_lanes(to->ray, there, from->ray, here, 1);
    move_lanes(to->born, there, from->born, here, 1);
    to->live |= there;
    return here;
}

// Takes rays from `ready`, which is made anew from the queue whenever it is empty.
static int refill_shadows(struct pool *to, struct pool *ready, int next, int steps,
                          const struct convex *work) {
    struct desk *desk = work->desk;
    unsigned ended = ~to->live & ((1u << LANES) - 1), all = ended;
    while (ended) {
        while (!ready->live && next < desk->shadows) {
            struct rays r = waiting(desk->shadow, next, desk->shadows);
            begin(&r, ready->nears, &desk->casters[0], work, &ready->march);
            ready->live = bits(r.active) & ~bits(ready->march.done);
            for (int lane = 0; lane < LANES; lane++)
                ready->ray[lane] = (float)(next + lane); // what is dark from the start adds nothing
            next += LANES;
        }
        if (!ready->live)
            break;
        ready->live &= ~move_rays(to, ended, ready, ready->live, work->scene);
        ended &= ~to->live;
    }
    unload(choose(lanes_of(all & to->live), set((float)steps), load(to->born)), to->born);
    to->march.done = lanes_of(~to->live);
    return next;
}

// Most rays that get as dark as that end on a surface, at a 300th of it and less: 0 is written for them, which errs by
// no more than that. LOOK_EVERY: steps from one look whether a ray is behind all to the next.
#define DARK 0x1p-10f
enum { LOOK_EVERY = 4 };

static void answer(const struct pool *from, unsigned which, struct desk *desk) {
    COUNT(answer, call);
    if (!which)
        return;
    ACTIVE(__builtin_popcount(which));
    COUNT(answer, some);
    float lit[LANES];
    mask dark = less(from->march.square, from->march.divisor * set(DARK * DARK));
    unload(drop(dark, root(from->march.square / from->march.divisor)), lit);
    for (unsigned rest = which; rest; rest &= rest - 1)
        add_lane((int)from->ray[__builtin_ctz(rest)], lit[__builtin_ctz(rest)], desk);
}

// Packets of shadow rays: ABREAST in work, as many of rays that leave, and the next that begin.
struct pools {
    struct pool *work, *out, *ready;
    int leaving; // lanes of `out` in use
};

// From |p| = e² on a Mandelbulb's estimate, |p|·ln|p|/3, grows faster than |p|: h passes 2·previous, where the
// estimator's circles of radius h and `previous` only touch, and a term may be anything. That is why rays on which
// no surface can bring a term below what they have still take the steps to there, in packets of such rays: one
// iteration each. `over`: beyond, where it is above 2·previous for good, or where a plane is nearer for good.
INLINE void over_bulb(int i, const struct march *m, const struct prepared *scene, mask *over) {
    const struct near *near = &m->nears[i];
    if (scene->placed[i].type != SHAPE_MANDELBULB)
        return;
    COUNT(over, bulb);
    struct vec p = vec_along(near->origin, near->direction, m->t);
    real square = vec_dot(p, p);
    mask beyond = greater(square, set(100.0f));
    if (scene->plane >= 0) {
        COUNT(over, plane);
        const struct near *plane = &m->nears[scene->plane];
        real r = root(square), height = mul_add(m->t, plane->direction.x, plane->origin.x);
        real least = r * log_of(r) * set(0.33f); // from 3 on its slope is 0.7
        mask under = both(less(height, least), less(plane->direction.x, set(0.69f)));
        beyond = either(beyond, both(under, greater(square, set(9.0f))));
    }
    *over = both(*over, beyond);
}

static inline mask over(const struct march *m, const struct prepared *scene) {
    COUNT(over, call);
    mask over = all_lanes();
    EACH_SHAPE(scene, over_bulb, m, KNOWN(scene), &over);
    return over;
}

static void see_off(struct pools *pools, const struct convex *work) {
    COUNT(see_off, call);
    const struct model *model = &KNOWN(work->scene)->model;
    real strength = set((float)model->shadow_strength),
         hit = set((float)work->scene->model.march.hit_distance);
    struct march m[ABREAST];
    int ended = 0;
    for (int k = 0; k < ABREAST; k++) {
        pools->out[k].march.done = lanes_of(~pools->out[k].live);
        m[k] = pools->out[k].march;
    }
    for (int i = 1; ended < ABREAST * LANES; i++) {
        COUNT(see_off, step);
        real oldest = set((float)i - (float)work->scene->model.march.max_steps);
        real h[ABREAST];
        nearest_bulbs(m, work->scene, true, h);
        ended = 0;
        for (int k = 0; k < ABREAST; k++) {
            step(&m[k], h[k], strength, hit, 0.0f);
            m[k].done = either(m[k].done, over(&m[k], work->scene));
            COUNT(see_off, packet);
            m[k].done = either(m[k].done, not_less(oldest, load(pools->out[k].born)));
            ended += count_of(m[k].done);
        }
    }
    for (int k = 0; k < ABREAST; k++) {
        pools->out[k].march = m[k];
        answer(&pools->out[k], pools->out[k].live, work->desk);
        pools->out[k].live = 0;
    }
    pools->leaving = 0;
}

static void retire_shadows(struct pool *from, struct pools *pools, const struct convex *work) {
    unsigned ended = from->live & bits(from->march.done), leaving = ended & from->leaving;
    answer(from, ended & ~leaving, work->desk);
    from->live &= ~ended;
    from->leaving &= ~ended;
    while (leaving) {
        struct pool *to = &pools->out[pools->leaving / LANES];
        unsigned room = ~to->live & ((1u << LANES) - 1);
        unsigned moved = move_rays(to, room, from, leaving, work->scene);
        leaving &= ~moved;
        pools->leaving += __builtin_popcount(moved);
        if (pools->leaving == ABREAST * LANES)
            see_off(pools, work);
    }
}

// One step of each packet. How many lanes have ended.
static inline int step_all(struct march *m, struct pool *pool, int steps,
                           const struct convex *work) {
    const struct model *model = &KNOWN(work->scene)->model;
    real strength = set((float)model->shadow_strength),
         hit = set((float)work->scene->model.march.hit_distance);
    COUNT(step_all, call);
    // Rays that old have had their steps.
    real oldest = set((float)steps - (float)work->scene->model.march.max_steps);
    real h[ABREAST];
    int ended = 0;
    nearest_bulbs(m, work->scene, false, h);
    for (int k = 0; k < ABREAST; k++) {
        mask behind = no_lane();
        if (steps % LOOK_EVERY == 0)
            behind = behind_all(&m[k], 1.0f / (float)model->shadow_strength, work->scene);
        step(&m[k], h[k], strength, hit, DARK * DARK);
        COUNT(step_all, packet);
        m[k].done = either(m[k].done, not_less(oldest, load(pool[k].born)));
        behind = but_not(m[k].done, behind);
        if (any(behind)) {
            COUNT(step_all, behind);
            real born = load(pool[k].born);
            unload(choose(behind, born - set((float)steps), born), pool[k].born);
            pool[k].leaving |= bits(behind);
            m[k].done = either(m[k].done, behind);
        }
        ended += count_of(m[k].done);
    }
    return ended;
}

// With a Mandelbulb in the scene, some rays take 1,000 steps: lanes are filled again as in bulb.c.
static void cast_streams(const struct convex *work) {
    struct desk *desk = work->desk;
    const struct model *model = &KNOWN(work->scene)->model;
    struct pool all[POOLS] = {0};
    memset(desk->near, 0, POOLS * (size_t)model->shape_count * sizeof(struct near));
    for (int k = 0; k < POOLS; k++)
        all[k].march.nears = all[k].nears = desk->near + k * model->shape_count;
    struct pools pools = {all, all + ABREAST, all + 2 * ABREAST, 0};
    int steps = 0;
    for (int next = 0;;) {
        struct march m[ABREAST];
        unsigned live = pools.ready->live;
        int ended = 0;
        for (int k = 0; k < ABREAST; k++) {
            next = refill_shadows(&pools.work[k], pools.ready, next, steps, work);
            live |= pools.work[k].live;
            m[k] = pools.work[k].march;
            ended += count_of(m[k].done);
        }
        if (!live)
            break;
        bool more = next < desk->shadows || pools.ready->live;
        int enough = more ? ended + LANES / 4 : ABREAST * LANES;
        while (ended < enough)
            ended = step_all(m, pools.work, ++steps, work);
        for (int k = 0; k < ABREAST; k++) {
            pools.work[k].march = m[k];
            retire_shadows(&pools.work[k], &pools, work);
        }
    }
    if (pools.leaving > 0)
        see_off(&pools, work);
    desk->shadows = 0;
}

// A packet that is marched, and how far it is.
struct cast {
    struct march march;
    mask active;
    int first, steps; // first: of its rays in the queue, −1: none
};

static void begin_cast(struct cast *c, int slot, int first, const struct convex *work) {
    struct desk *desk = work->desk;
    struct rays r = waiting(desk->shadow, first, desk->shadows);
    begin(&r, desk->near + slot * KNOWN(work->scene)->model.shape_count, &desk->casters[slot], work,
          &c->march);
    c->active = r.active;
    c->first = first;
    c->steps = work->scene->model.march.max_steps;
}

// A ray that one convex solid alone can darken: nothing else is nearer than q·t, q = lit_slope. The distance to what is
// convex is a convex function along a ray, so that its ratio to t falls, and then rises. If the ratio was below q at `from`,
// and so was this solid's, and has not fallen since, it never falls below what it is now, r: no later term is below
// strength·√¾·r (opt9_convex's NOTES.md, 5.). Ends the rays that have less than that.
static inline void end_risen(struct march *m, real from, real before, float q, real enough) {
    ACTIVE(LANES - count_of(m->done));
    COUNT(end_risen, call);
    real h = m->previous, t = m->from;
    mask risen = both(less(before, set(q) * from), not_less(h * from, before * t));
    real least = m->square * (t * t), now = m->divisor * (h * h);
    mask darker = less(least, now * enough);
    m->done = either(m->done, both(m->one, both(risen, darker)));
}

static void end_cast(struct cast *c, struct desk *desk) {
    ACTIVE(LANES);
    COUNT(end_cast, call);
    float (*field)[QUEUE_ROOM] = desk->shadow;
    real lit = root(c->march.square / c->march.divisor);
    add_light(c->active, vec_scale(load_vec(field + S_LIGHT, c->first), lit),
              load(&field[S_PIXEL][c->first]), desk);
    c->first = -1;
}

// One step waits for several roots in a row: the CPU works on other packets meanwhile.
static void cast_packets(const struct convex *work) {
    struct desk *desk = work->desk;
    const struct prepared *scene = work->scene;
    real strength = set((float)KNOWN(scene)->model.shadow_strength),
         hit = set((float)scene->model.march.hit_distance);
    real enough = strength * strength * set(0.7499f);
    COUNT(cast_packets, call);
    struct cast cast[CASTS];
    int next = 0, live = 0;
    for (; live < CASTS && next < desk->shadows; live++, next += LANES)
        begin_cast(&cast[live], live, next, work);
    for (int k = live; k < CASTS; k++)
        cast[k].first = -1;
    while (live > 0)
        for (int k = 0; k < CASTS; k++) {
            struct cast *c = &cast[k];
            if (c->first < 0)
                continue;
            struct march *m = &c->march;
            if (c->steps-- > 0 && !all(m->done)) {
                real from = m->from, before = m->previous;
                step(m, nearest(m->nears, m->casters, m->t, m->done, scene), strength, hit, 0.0f);
                end_risen(m, from, before, KNOWN(scene)->lit_slope, enough);
                continue;
            }
            end_cast(c, desk);
            if (next < desk->shadows) {
                begin_cast(c, k, next, work);
                next += LANES;
            } else
                live--;
        }
}

void cast_shadows(const struct convex *work) {
    if (KNOWN(work->scene)->bulbs) {
        cast_streams(work);
        return;
    }
#ifndef SCENE_KERNEL
    if (IS_CROWD(work->scene)) {
        cast_crowd(work);
        return;
    }
#endif
    cast_packets(work);
    work->desk->shadows = 0;
}
