// Marches of shadow rays by the least distance to the shapes that can be the nearest (casters.c): the improved soft
// shadow of I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/rmshadows), after S. Aaltonen's
// GDC 2018 talk. From a plane the first steps are leapt over.
#include "umbra_bulbs.h"

// A distance falls no faster than t grows: what was h at t wakes where h + t is no more than the nearest shape's
// distance + t. 2^-18: of rounding. Before `from` a shape sleeps in any case.
__attribute__((always_inline)) static inline real nearest(struct near *nears, const int *casters,
                                                          int count, real t, mask done,
                                                          const struct prepared *scene) {
    ACTIVE(LANES - count_of(done));
    COUNT(nearest, call);
    real least = set(INFINITY);
    for (int k = 0; k < count; k++) {
        COUNT(nearest, shape);
        struct near *near = &nears[casters[k]];
        mask awake = both(not_less(least + t, near->wakes), not_less(t, near->from));
        if (!any(but_not(done, awake)))
            continue;
        COUNT(nearest, awake);
        real h = distance_along(near, t, &scene->placed[casters[k]]);
        near->wakes = (h + t) * set(1.0f - 0x1p-18f);
        least = least_of(least, h);
    }
    return least;
}

// From a plane the march's steps are a geometric row until something else is nearer: t₀·(1 + facing)^m. Its
// first term is strength·facing, all others are the same; least²: of those leapt over. A ray that leaves the bounds by
// these steps is done, with the terms that it has: it is not dark (umbra_bulbs.h asks).
#define STEEP 0.5f
static inline void leap(const struct rays *r, struct march *m, const struct prepared *scene,
                        real start, real strength, real hit_distance) {
    COUNT(leap, call);
    real one = set(1.0f), zero = set(0.0f), until = least_of(r->alone, r->end) * set(1.0f - 1e-5f);
    mask can = both(both(r->on_plane, r->active), not_less(until, start));
    // A march that is within the hit distance at its first step has no term at all.
    can = both(can, not_less(start * r->facing, hit_distance));
    if (!any(can))
        return;
    ACTIVE(count_of(can));
    COUNT(leap, asked);
    COUNT(leap, scalar);
    // As far as to the bounds, if nothing is near before: `until` may be ∞.
    real half = m->linear * set(-0.5f);
    until = least_of(until, half + root(most_of(mul_sub(half, half, m->constant), zero)));
    can = both(can, not_less(until, start));
    real c = r->facing, t = start;
    if (!any(both(can, less(c, set(STEEP > scene->lit_slope ? STEEP : scene->lit_slope))))) {
        // As towards a high light: no term of these steps is below 1, and they are few.
        COUNT(leap, steep);
        real before = start, grown = one + c;
        for (mask on = can; any(on); on = both(on, not_less(until, t))) {
            COUNT(leap, step);
            before = choose(on, t, before);
            t = choose(on, t * grown, t);
        }
        m->previous = choose(can, before * c, m->previous);
    } else {
        COUNT(leap, can);
        real grow = log_of(one + c);
        real steps = floor_of(log_of(most_of(until, start) / start) / grow) + one;
        real first = strength * c, ratio = set(0.5f) * (one + c);
        t = start * exp_of(steps * grow);
        real inside = neg_mul_add(ratio, ratio, one), beyond = neg_mul_add(c, ratio, one);
        real others = first * first * inside / (beyond * beyond);
        real least = least_of(first * first, choose(greater(steps, set(1.5f)), others, one));
        m->square = choose(can, least_of(m->square, least), m->square);
        m->previous = choose(can, t * c / (one + c), m->previous);
    }
    m->t = choose(can, t, start);
    mask left = greater(mul_add(m->t, m->t + m->linear, m->constant), zero);
    m->done = either(m->done, both(can, left));
}

// Whether rays miss a Mandelbulb's bounding sphere, of any other shape: yes. A march in there may end at once, lit, where the
// estimate is below the hit distance, or on its surface: what lies further on tells nothing.
static mask passes_bulb(const struct placed *s, const struct rays *r) {
    COUNT(passes_bulb, call);
    if (s->type != SHAPE_MANDELBULB)
        return all_lanes();
    COUNT(passes_bulb, bulb);
    struct vec v = to_centre(s, r->point);
    real along = most_of(vec_dot(v, r->to_light), set(0.0f));
    return less(along * along, vec_dot(v, v) - set(s->bound_sq));
}

void begin(struct rays *r, struct near *nears, int *casters, const struct convex *work,
           struct march *m) {
    const struct model *model = &work->scene->model;
    m->nears = nears;
    m->casters = casters;
    m->count = 0;
    m->previous = set(1e9f);
    m->from = set(0.0f);
    m->divisor = set(1.0f);
    ACTIVE(count_of(r->active));
    COUNT(begin, call);
    COUNT(begin, scalar);
    r->sharp = set(8 * SHARP * (float)work->scene->model.march.hit_distance);
    if (work->scene->tree.levels)
        crowd_ahead(r, nears, work);
    else
        m->count = choose_shapes(r, nears, casters, work);
    ACTIVE(count_of(r->active)); // what was called has set its own
    m->end = work->scene->bulbs ? set(INFINITY)
                                : r->end; // with a Mandelbulb see behind_all() and over()
    float radius = (float)model->march.bounds_radius;
    m->linear = set(2.0f) * vec_dot(r->point, r->to_light);
    m->constant = vec_dot(r->point, r->point) - set(radius * radius * (1.0f + 0x1p-20f));
    // Met at a slant: the march comes to it by steps that fall to 1 − cosine of the one before, so that the last
    // term is below strength·hit_distance/((1 − cosine)·t): at most 1e-4 here, and 0 is written for it. If it has the
    // steps to come there (e^-23 is 1e-10), and takes the first. Those before it is near the surface are not told: a low
    // cap may end it on the way. Nor what is met outside of the bounds, where the march has ended, or before its first step.
    real room = r->first * (set(1.0f) - r->cosine);
    double least_room = 1e4 * model->march.hit_distance * model->shadow_strength;
    if (least_room < model->march.surface_offset)
        least_room = model->march.surface_offset;
    real offset = set((float)model->march.surface_offset),
         hit = set((float)model->march.hit_distance);
    mask there = not_less(set(0.0f), mul_add(r->first, r->first + m->linear, m->constant));
    mask dark = both(both(both(r->active, there), greater(room, set((float)least_room))),
                     less(r->first, r->end));
    float least_cosine =
        model->march.max_steps < MANY_STEPS ? INFINITY : 23.0f / (float)model->march.max_steps;
    dark =
        both(dark, both(greater(r->cosine, set(least_cosine)), not_less(r->facing * offset, hit)));
    for (int i = 0; i < model->shape_count && work->scene->bulbs; i++)
        dark = both(dark, passes_bulb(&work->scene->placed[i], r));
    m->done = either(dark, not_in(r->active));
    m->square = drop(dark, set(1.0f));
    real strength = set((float)model->shadow_strength);
    m->t = offset;
    if (model->march.max_steps >= MANY_STEPS)
        leap(r, m, work->scene, offset, strength, hit);
    m->one = no_lane();
    if (!work->scene->bulbs && !work->scene->repeats) { // copies may come nearer again
        ACTIVE(count_of(r->active));
        COUNT(begin, solids);
        m->one = but_not(either(r->many, less(r->facing, set(work->scene->lit_slope))),
                         both(r->on_plane, r->active));
    }
}

// A ray that one convex solid alone can darken: nothing else is nearer than q·t, q = lit_slope. The distance to what is
// convex is a convex function along a ray, so that its ratio to t falls, and then rises. If the ratio was below q at `from`,
// and so was this solid's, and has not fallen since, it never falls below what it is now, r: no later term is below
// strength·√¾·r (NOTES.md, 5.). Ends the rays that have less than that.
static inline void end_risen(struct march *m, real from, real before, float q, real enough) {
    ACTIVE(LANES - count_of(m->done));
    COUNT(end_risen, call);
    real h = m->previous, t = m->from;
    mask risen = not_less_in(less_in(m->one, before, set(q) * from), h * from, before * t);
    real least = m->square * (t * t), now = m->divisor * (h * h);
    m->done = either(m->done, less_in(risen, least, now * enough));
}

static inline void march_on(struct march *m, real strength, real hit, real enough,
                            const struct prepared *scene) {
    COUNT(march_on, call);
    real from = m->from, before = m->previous;
    step(m, nearest(m->nears, m->casters, m->count, m->t, m->done, scene), strength, hit, 0.0f);
    end_risen(m, from, before, scene->lit_slope, enough);
}

static void cast_pair(int first, const struct convex *work) {
    struct desk *desk = work->desk;
    const struct model *model = &work->scene->model;
    float (*field)[QUEUE_ROOM] = desk->shadow;
    real strength = set((float)model->shadow_strength), hit = set((float)model->march.hit_distance);
    real enough = strength * strength * set(0.7499f); // ¾, but for rounding
    struct march a, b;
    struct rays r;
    waiting(field, first, desk->shadows, &r);
    begin(&r, desk->near, desk->casters, work, &a);
    mask active_a = r.active;
    waiting(field, first + LANES, desk->shadows, &r);
    begin(&r, desk->near + model->shape_count, desk->casters + model->shape_count, work, &b);
    mask active_b = r.active;
    ACTIVE(LANES);
    COUNT(cast_pair, call);
    for (int i = 0; i < model->march.max_steps; i++) {
        bool over = all(a.done);
        if (over && all(b.done))
            break;
        if (!over)
            march_on(&a, strength, hit, enough, work->scene);
        if (!all(b.done))
            march_on(&b, strength, hit, enough, work->scene);
    }
    add_light(active_a, vec_scale(load_vec(field + S_LIGHT, first), root(a.square / a.divisor)),
              load(&field[S_PIXEL][first]), desk);
    add_light(active_b,
              vec_scale(load_vec(field + S_LIGHT, first + LANES), root(b.square / b.divisor)),
              load(&field[S_PIXEL][first + LANES]), desk);
}

void cast_shadows(const struct convex *work) {
    if (work->scene->bulbs) {
        cast_streams(work);
        return;
    }
    if (work->scene->tree.levels) {
        cast_crowd(work);
        return;
    }
    for (int first = 0; first < work->desk->shadows; first += 2 * LANES)
        cast_pair(first, work);
    work->desk->shadows = 0;
}
