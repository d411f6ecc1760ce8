// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). A packet of rays marches until the last is done.
#include "trace.h"

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

// Where the rays of a packet are: at the distance before + t + last. t and the last step apart: their
// sum, rounded, would lose what places the hit on the surface.
struct progress {
    struct place origin; // at the distance `before`
    real before, t, last, evals;
    mask done, found;
    struct exit exit;
    int left;  // evaluations that every ray has before its cap
    mask deep; // a ray that started inside a shape has stepped back out of it
    real inside;
    struct nearness near;
};

// More counts of steps a float cannot hold; a ray that was asked for more ends here as at the cap.
enum { MOST_STEPS = 1 << 24 };

static int step_cap(const struct model *model) {
    return model->march.max_steps < MOST_STEPS ? model->march.max_steps : MOST_STEPS;
}

// Rays that march on from a hit have had some of their evaluations.
static int steps_left(const struct progress *at, int most) {
    float evals[LANES];
    unload(drop(at->done, at->evals), evals);
    int had = 0;
    for (int lane = 0; lane < LANES; lane++)
        had = (int)evals[lane] > had ? (int)evals[lane] : had;
    return most - had;
}

// Whether that was the last step of the packet.
static inline bool march_step(struct progress *at, int step, struct beam *beam,
                              const struct prepared *scene) {
    ACTIVE(LANES - count_of(at->done));
    COUNT(march, step);
    mask done = at->done;
    real t = at->t;
    real distance = sdf(beam, t, scene, done);
    at->evals = at->evals + drop(done, set(1.0f));
    real hit_distance = set((float)scene->model.march.hit_distance);
    mask reached = but_not(done, reaches(distance, t, hit_distance));
    at->t = t = t + drop(either(done, reached), distance);
    mask ended = either(reached, but_not(done, outside(at->exit, t)));
    if (any(ended)) {
        at->last = choose(reached, distance, at->last);
        at->found = either(at->found, reached);
        at->done = done = either(done, ended);
    }
    if (step >= at->left) // each ray by its own count, whatever its neighbours had
        at->done = done = either(done, not_less(at->evals, set((float)step_cap(&scene->model))));
    return all(done);
}

// A list of the packets whose bits are set.
static int listed(unsigned packets, int list[GROUP]) {
    int count = 0;
    for (int k = 0; k < GROUP; k++)
        if (packets >> k & 1)
            list[count++] = k;
    return count;
}

// Until every ray has ended, by the hit test of a float march, which errs with t. The packets take turns.
static void march(struct progress packets[GROUP], unsigned going, const struct rays *rays,
                  struct world *world) {
    const struct prepared *scene = world->scene;
    int list[GROUP], count = listed(going, list);
    for (int i = 0; i < count; i++) {
        COUNT(march, call);
        struct progress *at = &packets[list[i]];
        at->exit = leaving(at->origin, rays->direction[list[i]], &scene->model);
        at->left = steps_left(at, step_cap(&scene->model));
        at->t = keep(at->done, at->t); // what is done stays where it is
        at->last = keep(at->done, at->last);
    }
    for (int step = 1; count > 0; step++)
        for (int i = 0; i < count;) {
            int k = list[i];
            if (march_step(&packets[k], step, &world->beam[k], scene))
                list[i] = list[--count];
            else
                i++;
        }
}

// The shape that a ray was in when its march ended: the step back may have brought it nearer to another.
__attribute__((noinline)) static void stay_in(mask deep, real t, const struct prepared *scene,
                                              const struct approach *approach, real *shape) {
    ACTIVE(count_of(deep));
    COUNT(stay_in, call);
    real inside = set(-1.0f);
    nearest_shape(approach, t, scene, not_in(deep), &inside);
    *shape = choose(deep, inside, *shape);
}

// Each hit becomes an origin, in the frames of all shapes: there the distance is exact to the size of
// a shape, not of the way to it. A hit that is still further than twice the hit distance, because
// the march erred or its test was wider than the scene's, marches on from there: whether there is one.
static bool landed(struct progress *at, mask settled, struct vec direction,
                   const struct prepared *scene, struct beam *beam) {
    if (!any(at->found))
        return false;
    ACTIVE(count_of(at->found));
    COUNT(landed, call);
    COUNT(landed, scalar);
    float twice = 2.0f * (float)scene->model.march.hit_distance;
    mask sunk = both(but_not(settled, at->found), less(at->last, set(-twice)));
    if (any(sunk))
        stay_in(sunk, at->t, scene, beam->approach, &at->inside);
    at->deep = either(at->deep, sunk);
    // What has settled stays as it is to the bit, whatever its neighbours do.
    at->origin =
        place_choose(settled, at->origin, place_at(at->origin, direction, at->t, at->last));
    approach_origins(at->origin, scene, beam);
    at->near = near_hit(at->found, scene, beam);
    mask off =
        both(at->found, but_not(either(at->deep, settled), greater(at->near.distance, set(twice))));
    if (!any(off))
        return false;
    ACTIVE(count_of(off));
    COUNT(landed, on);
    // From where it surely was before that surface, be it as thin as an ulp of t.
    real back = keep(off, at->t * set(-0x1p-22f));
    at->origin.lo = vec_along(at->origin.lo, direction, back);
    at->before = choose(off, at->before + (at->t + (at->last + back)), at->before);
    approach_origins(at->origin, scene, beam);
    approach_directions(direction, scene, beam->approach);
    at->found = but_not(off, at->found);
    at->done = but_not(off, at->done);
    return true;
}

static struct hit hit_of(struct progress *at, struct vec direction, const struct prepared *scene,
                         struct beam *beam) {
    COUNT(hit_of, call);
    struct hit hit = {.found = at->found, .shape = set(-1.0f), .evals = at->evals};
    if (!any(at->found))
        return hit;
    real way = at->before + at->t;
    mask unmoved = not_less(set(0.0f), way); // hits wherever it starts
    hit.found = both(hit.found, either(within(at->origin, &scene->model), unmoved));
    struct nearness near = at->near;
    if (any(at->deep)) {
        COUNT(hit_of, deep);
        mask other = not_less(absolute(near.shape - at->inside), set(0.5f));
        near.contact = either(near.contact, both(at->deep, other));
        near.shape = choose(at->deep, at->inside, near.shape);
    }
    real slope;
    hit.normal = normal_at(direction, hit.found, &near, scene, beam->approach, &slope);
    ACTIVE(count_of(hit.found));
    COUNT(hit_of, end);
    hit.shape = choose(hit.found, near.shape, hit.shape);
    real more = drop(at->deep, newton(near.distance, slope, way));
    hit.t = at->before + (at->t + (at->last + more));
    hit.point = at->origin;
    hit.point.lo = vec_along(hit.point.lo, direction, more);
    approach_moved(more, scene, beam);
    return hit;
}

void ray_march(const struct rays *rays, struct world *world, struct hit hit[GROUP]) {
    const struct prepared *scene = world->scene;
    struct progress packets[GROUP];
    unsigned going = 0;
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(count_of(rays->active[k]));
        COUNT(ray_march, call);
        real zero = set(0.0f);
        packets[k] = (struct progress){.origin = rays->origin[k], .done = not_in(rays->active[k])};
        packets[k].before = packets[k].t = packets[k].last = packets[k].evals = zero;
        packets[k].found = packets[k].deep = no_lane();
        packets[k].inside = set(-1.0f);
        if (!any(rays->active[k]))
            continue;
        going |= 1u << k;
        approach_origins(rays->origin[k], scene, &world->beam[k]);
        approach_directions(rays->direction[k], scene, world->beam[k].approach);
    }
    while (going) {
        mask settled[GROUP];
        for (int k = 0; k < GROUP; k++)
            settled[k] = packets[k].found;
        march(packets, going, rays, world);
        for (int k = 0; k < GROUP; k++)
            if (going >> k & 1 &&
                !landed(&packets[k], settled[k], rays->direction[k], scene, &world->beam[k]))
                going &= ~(1u << k);
    }
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(count_of(packets[k].found));
        hit[k] = hit_of(&packets[k], rays->direction[k], scene, &world->beam[k]);
    }
}

// Rays to the light.
struct shade {
    real t, least, previous;
    mask done;
    struct exit exit;
};

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds. Whether that was the
// packet's last step.
static inline bool soft_step(struct shade *ray, struct beam *beam, const struct prepared *scene) {
    const struct model *model = &scene->model;
    ACTIVE(LANES - count_of(ray->done));
    COUNT(soft_shadow, eval);
    real t = ray->t, zero = set(0.0f);
    real h = sdf(beam, t, scene, ray->done);
    mask done = either(ray->done, reaches(h, t, set((float)model->march.hit_distance)));
    ray->done = done;
    if (all(done))
        return true;
    ACTIVE(LANES - count_of(done));
    COUNT(soft_shadow, step);
    real strength = set((float)model->shadow_strength);
    real square = h * h, y = square / (set(2.0f) * ray->previous);
    real inside = neg_mul_add(y, y, square), beyond = t - y;
    // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
    // In float it is noise wherever inside/h² is of the order of h's own error, 1e-5 at least.
    mask sound = both(greater(inside, square * set(2e-5f)), greater(beyond, zero));
    // strength·√inside/beyond < least, asked without the root: it is seldom so.
    real wanted = ray->least * beyond;
    mask darker = but_not(done, both(sound, less(strength * strength * inside, wanted * wanted)));
    if (any(darker)) {
        ACTIVE(count_of(darker));
        COUNT(soft_shadow, darker);
        ray->least = choose(darker, strength * root(inside) / beyond, ray->least);
    }
    ray->previous = h;
    ray->t = t = t + drop(done, h);
    ray->done = done = either(done, outside(ray->exit, t));
    return all(done);
}

static inline bool hard_step(struct shade *ray, real distance, struct beam *beam,
                             const struct prepared *scene) {
    ACTIVE(LANES - count_of(ray->done));
    COUNT(hard_shadow, test);
    real t = ray->t;
    mask done = either(ray->done, not_in(less(t, distance)));
    ray->done = done;
    if (all(done))
        return true;
    ACTIVE(LANES - count_of(done));
    COUNT(hard_shadow, step);
    real h = sdf(beam, t, scene, done);
    mask blocked = but_not(done, reaches(h, t, set((float)scene->model.march.hit_distance)));
    ray->least = drop(blocked, ray->least);
    done = either(done, blocked);
    ray->t = t = t + drop(done, h);
    ray->done = done = either(done, outside(ray->exit, t));
    return all(done);
}

void shadow(const struct hit hit[GROUP], const struct lighting light[GROUP], struct world *world,
            real reach[GROUP]) {
    const struct prepared *scene = world->scene;
    bool soft = scene->model.shadows == SHADOWS_SOFT;
    struct shade rays[GROUP];
    unsigned going = 0;
    for (int k = 0; k < GROUP; k++) {
        rays[k].least = set(1.0f);
        if (scene->model.shadows == SHADOWS_NONE || !any(light[k].lit))
            continue;
        ACTIVE(count_of(light[k].lit));
        COUNT(shadow, call);
        going |= 1u << k;
        approach_directions(light[k].to_light, scene, world->beam[k].approach);
        rays[k].exit = leaving(hit[k].point, light[k].to_light, &scene->model);
        rays[k].done = not_in(light[k].lit);
        rays[k].previous = set(1e20f);
        rays[k].t = set((float)scene->model.march.surface_offset);
    }
    int list[GROUP], count = listed(going, list);
    for (int step = 0; count > 0 && step < scene->model.march.max_steps; step++)
        for (int i = 0; i < count;) {
            int k = list[i];
            struct beam *beam = &world->beam[k];
            if (soft ? soft_step(&rays[k], beam, scene)
                     : hard_step(&rays[k], light[k].distance, beam, scene))
                list[i] = list[--count];
            else
                i++;
        }
    for (int k = 0; k < GROUP; k++)
        reach[k] = rays[k].least;
}
