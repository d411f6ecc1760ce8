// Marches of shadow rays by the least distance to the shapes that can be the nearest (casters.c): the improved soft
// shadow of I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/rmshadows), after S. Aaltonen's
// GDC 2018 talk. From a plane the first steps are leapt over.
#include "simd/pow.h"
#include "umbra_queue.h"

// A distance falls no faster than t grows: what was h at t wakes where h + t is no more than the nearest shape's
// distance + t. 2^-18: of rounding. Before `from` a shape sleeps in any case.
__attribute__((always_inline)) static inline void
near_to(int i, struct near *nears, vfloat t, vmask done, const struct known *scene, vfloat *least) {
    struct near *near = &nears[i];
    if (scene->placed[i].way == LINEAR) { // cheaper than to ask whether it sleeps
        COUNT(nearest, plane);
        *least = v_min(*least, v_madd(t, near->direction.x, near->origin.x));
        return;
    }
    COUNT(nearest, shape);
    vmask awake = v_cmp_ge_in(v_not(done), *least + t, near->wakes);
    if (!v_any(v_cmp_ge_in(awake, t, near->from)))
        return;
    COUNT(nearest, awake);
    vfloat h = distance_along(near, t, &scene->placed[i]);
    near->wakes = (h + t) * v_splat(1.0f - 0x1p-18f);
    *least = v_min(*least, h);
}

__attribute__((always_inline)) static inline vfloat nearest(struct near *nears,
                                                            const struct shapes *casters, vfloat t,
                                                            vmask done,
                                                            const struct prepared *scene) {
    ACTIVE(LANES - v_count(done));
    COUNT(nearest, call);
    vfloat least = v_splat(INFINITY);
    EACH_IN(*casters, near_to, nears, t, done, KNOWN(scene), &least);
    return least;
}

// From a plane the march's steps are a geometric row until something else is nearer: t₀·(1 + facing)^m. Its
// first term is strength·facing, all others are the same; least²: of those leapt over. A ray that leaves the bounds by
// these steps is done, with the terms that it has: it is not dark (umbra_bulbs.c asks).
#define STEEP 0.5f
static inline void leap(const struct rays *r, struct march *m, const struct known *scene,
                        vfloat start, vfloat strength, vfloat hit_distance) {
    COUNT(leap, call);
    vfloat one = v_splat(1.0f), zero = v_splat(0.0f),
           until = v_min(r->alone, r->end) * v_splat(1.0f - 1e-5f);
    vmask can = v_and(v_and(r->on_plane, r->active), v_cmp_ge(until, start));
    // A march that is within the hit distance at its first step has no term at all.
    can = v_and(can, v_cmp_ge(start * r->facing, hit_distance));
    if (!v_any(can))
        return;
    ACTIVE(v_count(can));
    COUNT(leap, asked);
    COUNT(leap, scalar);
    // As far as to the bounds, if nothing is near before: `until` may be ∞.
    vfloat half = m->linear * v_splat(-0.5f);
    until = v_min(until, half + v_sqrt(v_max(v_msub(half, half, m->constant), zero)));
    can = v_and(can, v_cmp_ge(until, start));
    vfloat c = r->facing, t = start;
    if (!v_any(v_and(can,
                     v_cmp_lt(c, v_splat(STEEP > scene->lit_slope ? STEEP : scene->lit_slope))))) {
        // As towards a high light: no term of these steps is below 1, and they are few.
        COUNT(leap, steep);
        vfloat before = start, grown = one + c;
        for (vmask on = can; v_any(on); on = v_and(on, v_cmp_ge(until, t))) {
            COUNT(leap, step);
            before = v_select(on, t, before);
            t = v_select(on, t * grown, t);
        }
        m->previous = v_select(can, before * c, m->previous);
    } else {
        COUNT(leap, can);
        vfloat grow = v_log(one + c);
        vfloat steps = v_floor(v_log(v_max(until, start) / start) / grow) + one;
        vfloat first = strength * c, ratio = v_splat(0.5f) * (one + c);
        t = start * v_exp(steps * grow);
        vfloat inside = v_nmadd(ratio, ratio, one), beyond = v_nmadd(c, ratio, one);
        vfloat others = first * first * inside / (beyond * beyond);
        vfloat least = v_min(first * first, v_select(v_cmp_gt(steps, v_splat(1.5f)), others, one));
        m->square = v_select(can, v_min(m->square, least), m->square);
        m->previous = v_select(can, t * c / (one + c), m->previous);
    }
    m->t = v_select(can, t, start);
    vmask left = v_cmp_gt(v_madd(m->t, m->t + m->linear, m->constant), zero);
    m->done = v_or(m->done, v_and(can, left));
}

// Whether rays miss a Mandelbulb's bounding sphere. A march in there may end at once, lit, where the estimate is below the
// hit distance, or on its surface: what lies further on tells nothing.
INLINE void passes_bulb(int i, const struct rays *r, const struct known *scene, vmask *dark) {
    const struct placed *s = &scene->placed[i];
    COUNT(passes_bulb, call);
    if (s->type != SHAPE_MANDELBULB)
        return;
    COUNT(passes_bulb, bulb);
    struct vec v = to_centre(s, r->point);
    vfloat along = v_max(vec_dot(v, r->to_light), v_splat(0.0f));
    *dark = v_and(*dark, v_cmp_lt(along * along, vec_dot(v, v) - v_splat(s->bound_sq)));
}

SHARED void begin(struct rays *r, struct near *nears, struct shapes *casters,
                  const struct convex *work, struct march *m) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    m->nears = nears;
    m->casters = casters;
    m->previous = v_splat(1e9f);
    m->from = v_splat(0.0f);
    m->divisor = v_splat(1.0f);
    ACTIVE(v_count(r->active));
    COUNT(begin, call);
    COUNT(begin, scalar);
    r->sharp = v_splat(8 * SHARP * (float)work->scene->model.march.hit_distance);
    if (IS_CROWD(work->scene))
        crowd_ahead(r, nears, work);
    else
        choose_shapes(r, nears, casters, work);
    ACTIVE(v_count(r->active)); // what was called has set its own
    m->end = KNOWN(work->scene)->bulbs ? v_splat(INFINITY)
                                       : r->end; // with a Mandelbulb see behind_all() and over()
    float radius = (float)model->march.bounds_radius;
    m->linear = v_splat(2.0f) * vec_dot(r->point, r->to_light);
    m->constant = vec_dot(r->point, r->point) - v_splat(radius * radius * (1.0f + 0x1p-20f));
    // Met at a slant: the march comes to it by steps that fall to 1 − cosine of the one before, so that the last
    // term is below strength·hit_distance/((1 − cosine)·t): at most 1e-4 here, and 0 is written for it. If it has the
    // steps to come there (e^-23 is 1e-10), and takes the first. Those before it is near the surface are not told: a low
    // cap may end it on the way. Nor what is met outside of the bounds, where the march has ended, or before its first step.
    vfloat room = r->first * (v_splat(1.0f) - r->cosine);
    const struct limits *march = &work->scene->model.march;
    double least_room = 1e4 * march->hit_distance * model->shadow_strength;
    if (least_room < march->surface_offset)
        least_room = march->surface_offset;
    vfloat offset = v_splat((float)model->march.surface_offset),
           hit = v_splat((float)march->hit_distance);
    vmask there = v_cmp_ge(v_splat(0.0f), v_madd(r->first, r->first + m->linear, m->constant));
    vmask dark = v_and(v_and(v_and(r->active, there), v_cmp_gt(room, v_splat((float)least_room))),
                       v_cmp_lt(r->first, r->end));
    float least_cosine = march->max_steps < MANY_STEPS ? INFINITY : 23.0f / (float)march->max_steps;
    dark = v_and(
        dark, v_and(v_cmp_gt(r->cosine, v_splat(least_cosine)), v_cmp_ge(r->facing * offset, hit)));
    if (KNOWN(work->scene)->bulbs)
        EACH_SHAPE(work->scene, passes_bulb, r, KNOWN(work->scene), &dark);
    m->done = v_or(dark, v_not(r->active));
    m->square = v_zero_where(dark, v_splat(1.0f));
    vfloat strength = v_splat((float)model->shadow_strength);
    m->t = offset;
    if (march->max_steps >= MANY_STEPS)
        leap(r, m, KNOWN(work->scene), offset, strength, hit);
    m->one = v_mask_none();
    if (r->floor && !KNOWN(work->scene)->bulbs &&
        !KNOWN(work->scene)->repeats) { // copies may come nearer again
        ACTIVE(v_count(r->active));
        COUNT(begin, floor);
        m->one = v_andnot(
            v_or(r->many, v_cmp_lt(r->facing, v_splat(KNOWN(work->scene)->lit_slope))), r->active);
    }
}

// A packet that is marched, and how far it is.
struct cast {
    struct march march;
    vmask active;
    int first, steps; // first: of its rays in the queue
    bool over;
};

// The next packet of the queue, if there is one; the first ray behind it.
static int begin_cast(struct cast *c, int slot, int next, const struct convex *work) {
    struct desk *desk = work->desk;
    c->over = next >= desk->shadows;
    c->first = c->over ? -1 : next;
    if (c->over)
        return next;
    struct rays r;
    waiting(desk->shadow, next, desk->shadows, &r);
    begin(&r, desk->near + slot * KNOWN(work->scene)->model.shape_count, &desk->casters[slot], work,
          &c->march);
    c->active = r.active;
    c->steps = work->scene->model.march.max_steps;
    return next + LANES;
}

// A ray that one convex solid alone can darken: nothing else is nearer than q·t, q = lit_slope. The distance to what is
// convex is a convex function along a ray, so that its ratio to t falls, and then rises. If the ratio was below q at `from`,
// and so was this solid's, and has not fallen since, it never falls below what it is now, r: no later term is below
// strength·√¾·r (NOTES.md, 5.). Ends the rays that have less than that.
static inline void end_risen(struct march *m, vfloat from, vfloat before, float q, vfloat enough) {
    ACTIVE(LANES - v_count(m->done));
    COUNT(end_risen, call);
    vfloat h = m->previous, t = m->from;
    vmask risen = v_cmp_ge_in(v_cmp_lt_in(m->one, before, v_splat(q) * from), h * from, before * t);
    vfloat least = m->square * (t * t), now = m->divisor * (h * h);
    m->done = v_or(m->done, v_cmp_lt_in(risen, least, now * enough));
}

static void end_cast(const struct cast *c, struct desk *desk) {
    ACTIVE(LANES);
    COUNT(end_cast, call);
    float (*field)[QUEUE_ROOM] = desk->shadow;
    vfloat lit = v_sqrt(c->march.square / c->march.divisor);
    add_light(c->active, vec_scale(load_vec(field + S_LIGHT, c->first), lit),
              v_load(&field[S_PIXEL][c->first]), desk);
}

// CASTS packets by turns: one step waits for several roots in a row, and the CPU works on the other packets meanwhile. If
// REFILL_CASTS, the next packet takes the place of one that is over; else all end, and bring their light in the queue's order.
void cast_packets(const struct convex *work) {
    struct desk *desk = work->desk;
    const struct prepared *scene = work->scene;
    vfloat strength = v_splat((float)KNOWN(scene)->model.shadow_strength),
           hit = v_splat((float)scene->model.march.hit_distance);
    vfloat enough = strength * strength * v_splat(0.7499f); // ¾, but for rounding
    COUNT(cast_packets, call);
    struct cast cast[CASTS];
    for (int next = 0; next < desk->shadows;) {
        int live = CASTS;
        for (int k = 0; k < CASTS; k++) {
            next = begin_cast(&cast[k], k, next, work);
            live -= cast[k].over;
        }
        while (live > 0)
            for (int k = 0; k < CASTS; k++) {
                struct cast *c = &cast[k];
                if (c->over)
                    continue;
                struct march *m = &c->march;
                if (c->steps-- > 0 && !v_all(m->done)) {
                    vfloat from = m->from, before = m->previous;
                    step(m, nearest(m->nears, m->casters, m->t, m->done, scene), strength, hit,
                         0.0f);
                    end_risen(m, from, before, KNOWN(scene)->lit_slope, enough);
                    continue;
                }
                c->over = true;
                if (REFILL_CASTS) {
                    end_cast(c, desk);
                    next = begin_cast(c, k, next, work);
                }
                live -= c->over;
            }
        for (int k = 0; k < CASTS && !REFILL_CASTS; k++)
            if (cast[k].first >= 0)
                end_cast(&cast[k], desk);
    }
    desk->shadows = 0;
}
