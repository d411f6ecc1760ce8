// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). A packet of rays marches until the last is done.
#include "trace.h"

#include <limits.h>

// A ray leaves the bounds when |o + t·d|² > radius²: a polynomial in t, free of the point itself, and
// known to a few 2^-24 of radius²: within 2^-20 the ray goes on, and its hit is asked by within().
struct exit {
    real linear, constant; // t·(t + linear) + constant > 0
};

static struct exit leaving(struct place origin, struct vec direction, const struct model *model) {
    COUNT(leaving, call);
    COUNT(leaving, scalar);
    float radius = (float)model->march.bounds_radius;
    struct vec o = origin.hi;
    return (struct exit){set(2.0f) * vec_dot(o, direction),
                         vec_dot(o, o) - set(radius * radius * (1.0f + 0x1p-20f))};
}

static mask within(struct place place, const struct model *model) {
    COUNT(within, call);
    COUNT(within, scalar);
    double radius = model->march.bounds_radius;
    return not_less(set(0.0f), power_at(wide_place(place), radius * radius));
}

static inline mask outside(struct exit exit, real t) {
    return greater(mul_add(t, t + exit.linear, exit.constant), set(0.0f));
}

// The hit test that float can keep: below half an ulp of t, 2^-24·t at the most, a step no longer
// moves the ray, and it would stall there until the step cap.
static inline mask reaches(real distance, real t, real hit_distance) {
    return less(distance, most_of(hit_distance, t * set(0x1p-24f)));
}

// Newton's last step: more than h is left to go where a ray grazes, 33 times on scene0's plane at the
// horizon. Only for what float's march may err by: what a larger hit_distance leaves is the scene's.
static inline real newton(real h, real slope, real way) {
    COUNT(newton, call);
    mask own = less(absolute(h), way * set(0x1p-21f));
    return keep(own, h / most_of(slope, set(0x1p-9f)));
}

// Where the rays are: at the distance before + t + last. t and the last step apart: their sum,
// rounded, would lose what places the hit on the surface.
struct progress {
    struct place origin; // at the distance `before`
    real before, t, last, evals;
    mask done, found;
    int steps; // of the ray that has had fewest, of those that march on
};

// Until every ray has ended, by the hit test of a float march, which errs with t.
static inline void march(struct progress *at, struct vec direction, const struct world *world) {
    COUNT(march, call);
    const struct prepared *scene = world->scene;
    struct exit exit = leaving(at->origin, direction, &scene->model);
    real hit_distance = set((float)scene->model.march.hit_distance);
    mask done = at->done, found = at->found;
    real t = set(0.0f), last = t, evals = at->evals;
    for (int step = at->steps; step < scene->model.march.max_steps; step++) {
        ACTIVE(LANES - count_of(done));
        COUNT(march, step);
        real distance = sdf(world->approach, t, scene, done, NULL);
        evals = evals + drop(done, set(1.0f));
        mask reached = but_not(done, reaches(distance, t, hit_distance));
        last = choose(reached, distance, last);
        t = t + drop(either(done, reached), distance);
        mask ended = either(reached, but_not(done, outside(exit, t)));
        if (any(ended)) {
            found = either(found, reached);
            done = either(done, ended);
            if (all(done))
                break;
        }
    }
    *at = (struct progress){at->origin, at->before, t, last, evals, done, found, at->steps};
}

// The shape that a ray was in when its march ended: the step back may have brought it nearer to another.
__attribute__((noinline)) static void stay_in(mask deep, real t, const struct world *world,
                                              real *shape) {
    ACTIVE(count_of(deep));
    COUNT(stay_in, call);
    real inside = set(-1.0f);
    sdf(world->approach, t, world->scene, not_in(deep), &inside);
    *shape = choose(deep, inside, *shape);
}

// Of these rays the fewest evaluations that one has had. Each has the cap to itself, whatever its neighbours took.
static int fewest(real evals, mask on) {
    float had[LANES];
    int least = INT_MAX;
    unload(evals, had);
    for (unsigned rest = bits(on); rest; rest &= rest - 1) {
        int evaluations = (int)had[__builtin_ctz(rest)];
        least = evaluations < least ? evaluations : least;
    }
    return least;
}

// Each hit becomes an origin, in the frames of all shapes: there the distance is exact to the size of
// a shape, not of the way to it. A hit that is still further than twice the hit distance, because
// the march erred or its test was wider than the scene's, marches on from there.
void ray_march(struct place origin, struct vec direction, mask active, const struct world *world,
               struct hit *hit) {
    COUNT(ray_march, call);
    COUNT(ray_march, scalar);
    const struct prepared *scene = world->scene;
    float twice = 2.0f * (float)scene->model.march.hit_distance;
    real zero = set(0.0f), off_from = set(twice), sunk_from = set(-twice);
    real most = set((float)scene->model.march.max_steps);
    struct progress at = {.origin = origin, .before = zero, .evals = zero, .found = no_lane()};
    at.done = not_in(active);
    mask deep = no_lane(); // a ray that started inside a shape has stepped back out of it
    real inside = set(-1.0f);
    struct nearness near = {zero, inside, no_lane()};
    approach_origins(origin, scene, world->approach);
    approach_directions(direction, scene, world->approach);
    for (;;) {
        mask settled = at.found;
        march(&at, direction, world);
        if (!any(at.found))
            break;
        ACTIVE(count_of(at.found));
        COUNT(ray_march, landed);
        // march() counts from the ray that has had fewest: others may have had more than the cap.
        at.found = but_not(greater(at.evals, most), at.found);
        mask sunk = both(at.found, less(at.last, sunk_from));
        if (any(sunk))
            stay_in(sunk, at.t, world, &inside);
        deep = either(deep, sunk);
        at.origin = place_at(at.origin, direction, at.t, at.last);
        approach_origins(at.origin, scene, world->approach);
        near = near_hit(at.found, world);
        mask off = both(at.found, but_not(either(deep, settled), greater(near.distance, off_from)));
        if (!any(off))
            break;
        ACTIVE(count_of(off));
        COUNT(ray_march, on);
        // From where it surely was before that surface, be it as thin as an ulp of t.
        real back = keep(off, at.t * set(-0x1p-22f));
        at.origin.lo = vec_along(at.origin.lo, direction, back);
        at.before = at.before + (at.t + (at.last + back));
        approach_origins(at.origin, scene, world->approach);
        approach_directions(direction, scene, world->approach);
        at.found = but_not(off, at.found);
        at.done = but_not(off, at.done);
        at.done = either(at.done, not_less(at.evals, most));
        int had = fewest(at.evals, off); // a float: from 2^24 on it stands still
        at.steps = had > at.steps ? had : at.steps + 1;
    }
    *hit = (struct hit){.found = at.found, .shape = set(-1.0f), .evals = least_of(at.evals, most)};
    if (!any(at.found))
        return;
    real way = at.before + at.t;
    mask unmoved = not_less(zero, way); // hits wherever it starts
    hit->found = both(hit->found, either(within(at.origin, &scene->model), unmoved));
    if (any(deep)) {
        COUNT(ray_march, deep);
        near.contact =
            either(near.contact, both(deep, not_less(absolute(near.shape - inside), set(0.5f))));
        near.shape = choose(deep, inside, near.shape);
    }
    real slope;
    hit->normal = normal_at(direction, hit->found, &near, world, &slope);
    ACTIVE(count_of(hit->found));
    COUNT(ray_march, end);
    hit->shape = choose(hit->found, near.shape, hit->shape);
    real more = drop(deep, newton(near.distance, slope, way));
    hit->t = at.before + (at.t + (at.last + more));
    hit->point = at.origin;
    hit->point.lo = vec_along(hit->point.lo, direction, more);
    approach_moved(more, scene, world->approach);
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds.
static real soft_shadow(mask active, struct exit exit, const struct world *world) {
    COUNT(soft_shadow, call);
    const struct prepared *scene = world->scene;
    const struct model *model = &scene->model;
    mask done = not_in(active);
    real hit_distance = set((float)model->march.hit_distance);
    real strength = set((float)model->shadow_strength), zero = set(0.0f);
    real least = set(1.0f), previous = set(1e20f), t = set((float)model->march.surface_offset);
    for (int step = 0; step < model->march.max_steps; step++) {
        ACTIVE(LANES - count_of(done));
        COUNT(soft_shadow, eval);
        real h = sdf(world->approach, t, scene, done, NULL);
        done = either(done, reaches(h, t, hit_distance));
        if (all(done))
            break;
        ACTIVE(LANES - count_of(done));
        COUNT(soft_shadow, step);
        real square = h * h, y = square / (set(2.0f) * previous);
        real inside = neg_mul_add(y, y, square), beyond = t - y;
        // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
        // In float it is noise wherever inside/h² is of the order of h's own error, 1e-5 at least.
        mask sound = both(greater(inside, square * set(2e-5f)), greater(beyond, zero));
        // strength·√inside/beyond < least, asked without the root: it is seldom so.
        real scaled = least * beyond;
        mask darker =
            but_not(done, both(sound, less(strength * strength * inside, scaled * scaled)));
        if (any(darker)) {
            ACTIVE(count_of(darker));
            COUNT(soft_shadow, darker);
            least = choose(darker, strength * root(inside) / beyond, least);
        }
        previous = h;
        t = t + drop(done, h);
        done = either(done, outside(exit, t));
    }
    return least;
}

static real hard_shadow(real distance, mask active, struct exit exit, const struct world *world) {
    COUNT(hard_shadow, call);
    const struct prepared *scene = world->scene;
    mask done = not_in(active);
    real hit_distance = set((float)scene->model.march.hit_distance);
    real lit = set(1.0f), t = set((float)scene->model.march.surface_offset);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        ACTIVE(LANES - count_of(done));
        COUNT(hard_shadow, test);
        done = either(done, not_in(less(t, distance)));
        if (all(done))
            break;
        ACTIVE(LANES - count_of(done));
        COUNT(hard_shadow, step);
        real h = sdf(world->approach, t, scene, done, NULL);
        mask blocked = but_not(done, reaches(h, t, hit_distance));
        lit = drop(blocked, lit);
        done = either(done, blocked);
        t = t + drop(done, h);
        done = either(done, outside(exit, t));
    }
    return lit;
}

// 1: the light reaches the point, 0: it does not; between, the penumbra of a soft shadow.
real shadow(struct place point, struct vec to_light, real distance, mask active,
            const struct world *world) {
    COUNT(shadow, call);
    const struct prepared *scene = world->scene;
    if (scene->model.shadows == SHADOWS_NONE)
        return set(1.0f);
    approach_directions(to_light, scene, world->approach);
    struct exit exit = leaving(point, to_light, &scene->model);
    return scene->model.shadows == SHADOWS_SOFT ? soft_shadow(active, exit, world)
                                                : hard_shadow(distance, active, exit, world);
}
