// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). A packet of rays marches until the last is done.
#include "rods.h"

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

static inline real beyond(struct exit exit, real t) { // > 0: outside
    return mul_add(t, t + exit.linear, exit.constant);
}

// The hit test that float can keep: below half an ulp of t, 2^-24·t at the most, a step no longer
// moves the ray, and it would stall there until the step cap.
static inline real least_step(real t, real hit_distance) {
    return most_of(hit_distance, t * set(0x1p-24f));
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
    real start; // where the first march begins
    int cap;    // of its evaluations
    mask found;
    struct exit exit;
    int left;  // steps that every ray has before its cap
    mask deep; // a ray that started inside a shape has stepped back out of it
    real inside;
    struct nearness near;
};

// More counts of steps a float cannot hold; a ray that was asked for more ends here as at the cap.
enum { MOST_STEPS = 1 << 24 };

int step_cap(const struct model *model) {
    return model->march.max_steps < MOST_STEPS ? model->march.max_steps : MOST_STEPS;
}

// Rays that march on from a hit have had some of their evaluations.
static int steps_left(const struct progress *at, mask live) {
    float evals[LANES];
    unload(keep(live, at->evals), evals);
    int had = 0;
    for (int lane = 0; lane < LANES; lane++)
        had = (int)evals[lane] > had ? (int)evals[lane] : had;
    return at->cap - had;
}

// Some rays have ended: those that have reached a surface, and others. Each has a cap of its own, whatever its
// neighbours had.
__attribute__((noinline)) static void march_ends(struct progress *at, int step, int k, mask going,
                                                 mask inside, struct group *group) {
    COUNT(march_ends, call);
    mask live = group->live[k], reached = but_not(going, live);
    at->last = choose(reached, group->distance[k], at->last);
    at->found = either(at->found, reached);
    real evals = at->evals + set((float)step);
    if (step >= at->left) {
        COUNT(march_ends, cap);
        inside = less_in(inside, evals, set((float)at->cap));
    }
    at->evals = choose(but_not(inside, live), evals, at->evals);
    group->live[k] = inside;
    group->high[k] = choose(inside, group->high[k], set(-INFINITY));
}

// The packets that have a live ray, and what of a ray that has none would wake a shape.
static void set_out(struct group *group) {
    group->count = 0;
    for (int k = 0; k < GROUP; k++) {
        group->high[k] = choose(group->live[k], group->beam[k].high, set(-INFINITY));
        if (any(group->live[k]))
            group->list[group->count++] = k;
        else
            group->t[k] = set(0.0f);
    }
}

// The step-th step of a packet, its distance known. False after the last.
static inline bool march_step(struct progress *at, int step, int k, struct group *group,
                              const struct model *model) {
    mask live = group->live[k];
    ACTIVE(count_of(live));
    COUNT(march_step, call);
    real t = group->t[k], distance = group->distance[k];
    mask going = not_less_in(live, distance, least_step(t, set((float)model->march.hit_distance)));
    group->t[k] = t = add_where(going, t, distance);
    mask inside = not_greater_in(going, beyond(at->exit, t), set(0.0f));
    if (same(inside, live) && step < at->left)
        return true;
    march_ends(at, step, k, going, inside, group);
    return any(group->live[k]);
}

// Until every ray has ended, by the hit test of a float march, which errs with t.
static void march(struct progress packets[GROUP], const struct rays *rays, struct world *world) {
    COUNT(march, call);
    const struct prepared *scene = world->scene;
    struct group *group = &world->group;
    set_out(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(count_of(group->live[k]));
        struct progress *at = &packets[k];
        at->exit = leaving(at->origin, rays->direction[k], &scene->model);
        at->left = steps_left(at, group->live[k]);
        group->t[k] = choose(group->live[k], at->start, at->t); // what is done stays where it is
        at->start = set(0.0f);
        at->last = drop(group->live[k], at->last);
    }
    struct alone alone = {.shape = -1};
    for (int step = 1; group->count > 0; step++) {
        scene_distances(group, scene, &alone);
        for (int i = 0; i < group->count;) {
            int k = group->list[i];
            if (march_step(&packets[k], step, k, group, &scene->model)) {
                i++;
                continue;
            }
            packets[k].t = group->t[k];
            group->list[i] = group->list[--group->count];
        }
    }
}

// The shape that a ray was in when its march ended: the step back may have brought it nearer to another.
__attribute__((noinline)) static void stay_in(mask deep, real t, const struct prepared *scene,
                                              const struct approach *approach, real *shape) {
    ACTIVE(count_of(deep));
    COUNT(stay_in, call);
    real inside = set(-1.0f);
    nearest_shape(approach, t, scene, deep, &inside);
    *shape = choose(deep, inside, *shape);
}

// Each hit becomes an origin, in the frames of all shapes: there the distance is exact to the size of
// a shape, not of the way to it. A hit that is still further than twice the hit distance, because
// the march erred or its test was wider than the scene's, marches on from there: whether there is one.
static bool landed(struct progress *at, mask settled, struct vec direction,
                   const struct prepared *scene, struct beam *beam, mask *live) {
    ACTIVE(count_of(at->found));
    COUNT(landed, call);
    if (!any(at->found))
        return false;
    COUNT(landed, point);
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
    *live = less_in(off, at->evals, set((float)at->cap));
    return any(*live);
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
    COUNT(ray_march, call);
    const struct prepared *scene = world->scene;
    struct progress packets[GROUP];
    unsigned going = 0;
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(count_of(rays->active[k]));
        real zero = set(0.0f);
        packets[k] = (struct progress){.origin = rays->origin[k]};
        packets[k].before = packets[k].t = packets[k].last = packets[k].evals = zero;
        packets[k].start = rays->start[k];
        packets[k].cap = rays->cap;
        packets[k].found = packets[k].deep = no_lane();
        packets[k].inside = set(-1.0f);
        world->group.live[k] = rays->active[k];
        if (!any(rays->active[k]))
            continue;
        going |= 1u << k;
        approach_origins(rays->origin[k], scene, &world->group.beam[k]);
        approach_directions(rays->direction[k], scene, world->group.beam[k].approach);
    }
    while (going) {
        mask settled[GROUP];
        for (int k = 0; k < GROUP; k++)
            settled[k] = packets[k].found;
        march(packets, rays, world);
        for (int k = 0; k < GROUP; k++)
            if (going >> k & 1 && !landed(&packets[k], settled[k], rays->direction[k], scene,
                                          &world->group.beam[k], &world->group.live[k]))
                going &= ~(1u << k);
    }
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(count_of(packets[k].found));
        hit[k] = hit_of(&packets[k], rays->direction[k], scene, &world->group.beam[k]);
    }
}

// Rays to the light.
struct shade {
    real least_sq; // of the light so far: the root is taken once, of what is left in the end
    real twice_previous;
    struct exit exit;
};

// The rays that are still under way, after some have ended.
__attribute__((noinline)) static bool shade_ends(int k, mask live, struct group *group) {
    group->live[k] = live;
    group->high[k] = choose(live, group->high[k], set(-INFINITY));
    return any(live);
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds. False after the
// packet's last step.
static inline bool soft_step(struct shade *ray, int k, float strength_sq, struct group *group,
                             const struct model *model) {
    mask live = group->live[k];
    ACTIVE(count_of(live));
    COUNT(soft_step, call);
    real t = group->t[k], h = group->distance[k], zero = set(0.0f);
    mask going = not_less_in(live, h, least_step(t, set((float)model->march.hit_distance)));
    if (!any(going))
        return shade_ends(k, going, group);
    ACTIVE(count_of(going));
    COUNT(soft_step, step);
    // y = h²/(2·previous); inside = h² − y², past = t − y. Asked without a division: both times 2·previous.
    real twice = ray->twice_previous;
    real square = h * h, scale = twice * twice, inside = scale - square;
    real past = mul_sub(twice, t, square);
    // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
    // In float it is noise wherever inside/h² is of the order of h's own error, 1e-5 at least.
    mask sound = less_in(less_in(going, scale * set(2e-5f), inside), zero, past);
    // (strength·h·√inside/past)² < least², asked without the division: it is seldom so.
    real term = set(strength_sq) * square * inside, per = past * past;
    mask darker = less_in(sound, term, ray->least_sq * per);
    if (any(darker)) {
        ACTIVE(count_of(darker));
        COUNT(soft_step, darker);
        ray->least_sq = choose(darker, term / past / past, ray->least_sq); // past² may overflow
    }
    ray->twice_previous = h + h;
    group->t[k] = t = add_where(going, t, h);
    mask on = not_greater_in(going, beyond(ray->exit, t), zero);
    return same(on, live) || shade_ends(k, on, group);
}

static inline bool hard_step(struct shade *ray, real distance, int k, struct group *group,
                             const struct model *model) {
    // Past the light a ray is lit, and has taken one evaluation too many.
    ACTIVE(count_of(group->live[k]));
    COUNT(hard_step, call);
    real t = group->t[k], h = group->distance[k];
    mask live = group->live[k], before = less_in(live, t, distance);
    mask going = not_less_in(before, h, least_step(t, set((float)model->march.hit_distance)));
    ray->least_sq = drop(but_not(going, before), ray->least_sq);
    group->t[k] = t = add_where(going, t, h);
    mask on = not_greater_in(going, beyond(ray->exit, t), set(0.0f));
    return same(on, live) || shade_ends(k, on, group);
}

void shadow(const struct hit hit[GROUP], const struct lighting light[GROUP], struct world *world,
            real reach[GROUP]) {
    COUNT(shadow, call);
    COUNT(shadow, scalar);
    const struct model *model = &world->scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct group *group = &world->group;
    bool soft = model->shadows == SHADOWS_SOFT;
    struct shade rays[GROUP];
    for (int k = 0; k < GROUP; k++) {
        rays[k].least_sq = set(1.0f);
        group->live[k] = model->shadows == SHADOWS_NONE ? no_lane() : light[k].lit;
    }
    set_out(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(count_of(light[k].lit));
        approach_directions(light[k].to_light, world->scene, group->beam[k].approach);
        rays[k].exit = leaving(hit[k].point, light[k].to_light, model);
        rays[k].twice_previous = set(1e14f); // its square, times t's and the strength's, is a float
        group->t[k] = set((float)model->march.surface_offset);
    }
    struct alone alone = {.shape = -1};
    for (int step = 0; group->count > 0 && step < model->march.max_steps; step++) {
        scene_distances(group, world->scene, &alone);
        for (int i = 0; i < group->count;) {
            int k = group->list[i];
            if (soft ? soft_step(&rays[k], k, strength_sq, group, model)
                     : hard_step(&rays[k], light[k].distance, k, group, model))
                i++;
            else
                group->list[i] = group->list[--group->count];
        }
    }
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(count_of(light[k].lit));
        COUNT(shadow, end);
        reach[k] = root(rays[k].least_sq);
    }
}
