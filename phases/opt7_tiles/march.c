// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). A packet of rays marches until the last is done.
#include "tiles.h"

struct exit leaving(struct place origin, struct vec direction, const struct model *model) {
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
    real start; // t of the next evaluation
    mask live, found;
    struct exit exit;
    int left;  // steps that every ray has before its cap
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
static int steps_left(const struct progress *at, int cap) {
    float evals[LANES];
    unload(keep(at->live, at->evals), evals);
    int had = 0;
    for (int lane = 0; lane < LANES; lane++)
        had = (int)evals[lane] > had ? (int)evals[lane] : had;
    return cap - had;
}

// Some rays have ended: those that have reached a surface, and others. Each has a cap of its own, whatever its
// neighbours had.
__attribute__((noinline)) static void march_ends(struct progress *at, int step, real distance,
                                                 mask going, mask inside, struct beam *beam,
                                                 int cap) {
    mask reached = but_not(going, at->live);
    at->last = choose(reached, distance, at->last);
    at->found = either(at->found, reached);
    real evals = at->evals + set((float)step);
    if (step >= at->left)
        inside = less_in(inside, evals, set((float)cap));
    at->evals = choose(but_not(inside, at->live), evals, at->evals);
    at->live = inside;
    beam->high = choose(inside, beam->high, set(-INFINITY));
}

// The step-th step. False after the packet's last.
static inline bool march_step(struct progress *at, int step, struct beam *beam,
                              const struct prepared *scene) {
    ACTIVE(count_of(at->live));
    COUNT(march, step);
    real t = at->t, hit_distance = set((float)scene->model.march.hit_distance);
    real distance = sdf(beam, t, scene, at->live);
    mask going = not_less_in(at->live, distance, least_step(t, hit_distance));
    at->t = t = add_where(going, t, distance);
    mask inside = not_greater_in(going, beyond(at->exit, t), set(0.0f));
    if (same(inside, at->live) && step < at->left)
        return true;
    march_ends(at, step, distance, going, inside, beam, step_cap(&scene->model));
    return any(at->live);
}

// The same steps where a plane is all that the rays can hit: nothing but t changes.
static void march_line(struct progress *at, struct beam *beam, const struct prepared *scene) {
    const struct approach *line = &beam->approach[*beam->list.shape];
    real origin = line->origin.x, direction = line->direction.x, t = at->t;
    real hit_distance = set((float)scene->model.march.hit_distance);
    const struct exit exit = at->exit;
    mask live = at->live;
    for (int step = 1; any(live); step++) {
        ACTIVE(count_of(live));
        COUNT(march_line, step);
        real distance = mul_add(t, direction, origin);
        mask going = not_less_in(live, distance, least_step(t, hit_distance));
        t = add_where(going, t, distance);
        mask inside = not_greater_in(going, beyond(exit, t), set(0.0f));
        if (same(inside, live) && step < at->left)
            continue;
        march_ends(at, step, distance, going, inside, beam, step_cap(&scene->model));
        live = at->live;
    }
    at->t = t;
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
        at->t = choose(at->live, at->start, at->t); // what is done stays where it is
        at->start = set(0.0f);
        at->last = drop(at->live, at->last);
        struct beam *beam = &world->beam[list[i]];
        beam->high = choose(at->live, beam->high, set(-INFINITY));
    }
    for (int i = 0; i < count;) {
        struct list shapes = world->beam[list[i]].list;
        if (shapes.count == 1 && scene->placed[*shapes.shape].way == LINEAR) {
            march_line(&packets[list[i]], &world->beam[list[i]], scene);
            list[i] = list[--count];
        } else
            i++;
    }
    for (int step = 1; count > 0; step++)
        for (int i = 0; i < count;) {
            int k = list[i];
            if (march_step(&packets[k], step, &world->beam[k], scene))
                i++;
            else
                list[i] = list[--count];
        }
}

// The shape that a ray was in when its march ended: the step back may have brought it nearer to another.
__attribute__((noinline)) static void stay_in(mask deep, real t, const struct prepared *scene,
                                              const struct beam *beam, real *shape) {
    ACTIVE(count_of(deep));
    COUNT(stay_in, call);
    real inside = set(-1.0f);
    nearest_shape(beam, t, scene, deep, &inside);
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
        stay_in(sunk, at->t, scene, beam, &at->inside);
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
    approach_directions(direction, scene, beam);
    at->found = but_not(off, at->found);
    at->live = off;
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
    hit.normal = normal_at(direction, hit.found, &near, scene, beam, &slope);
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
        packets[k] = (struct progress){.origin = rays->origin[k], .live = rays->active[k]};
        packets[k].before = packets[k].t = packets[k].last = packets[k].evals = zero;
        packets[k].found = packets[k].deep = no_lane();
        packets[k].inside = set(-1.0f);
        packets[k].start = rays->start;
        if (!any(rays->active[k]))
            continue;
        going |= 1u << k;
        approach_origins(rays->origin[k], scene, &world->beam[k]);
        approach_directions(rays->direction[k], scene, &world->beam[k]);
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
    mask live;
    struct exit exit;
};

// The rays that are still under way, after some have ended.
__attribute__((noinline)) static bool shade_ends(struct shade *ray, mask live, struct beam *beam) {
    ray->live = live;
    beam->high = choose(live, beam->high, set(-INFINITY));
    return any(live);
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds. False after the
// packet's last step.
static inline bool soft_step(struct shade *ray, struct beam *beam, const struct prepared *scene) {
    const struct model *model = &scene->model;
    ACTIVE(count_of(ray->live));
    COUNT(soft_shadow, eval);
    real t = ray->t, zero = set(0.0f);
    real h = sdf(beam, t, scene, ray->live);
    real hit_distance = set((float)model->march.hit_distance);
    mask going = not_less_in(ray->live, h, least_step(t, hit_distance));
    if (!any(going))
        return false;
    ACTIVE(count_of(going));
    COUNT(soft_shadow, step);
    real strength = set((float)model->shadow_strength);
    real square = h * h, y = square / (set(2.0f) * ray->previous);
    real inside = neg_mul_add(y, y, square), past = t - y;
    // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
    // In float it is noise wherever inside/h² is of the order of h's own error, 1e-5 at least.
    mask sound = less_in(less_in(going, square * set(2e-5f), inside), zero, past);
    // strength·√inside/past < least, asked without the root: it is seldom so.
    real wanted = ray->least * past;
    mask darker = less_in(sound, strength * strength * inside, wanted * wanted);
    if (any(darker)) {
        ACTIVE(count_of(darker));
        COUNT(soft_shadow, darker);
        ray->least = choose(darker, strength * root(inside) / past, ray->least);
    }
    ray->previous = h;
    ray->t = t = add_where(going, t, h);
    mask on = not_greater_in(going, beyond(ray->exit, t), zero);
    return same(on, ray->live) || shade_ends(ray, on, beam);
}

static inline bool hard_step(struct shade *ray, real distance, struct beam *beam,
                             const struct prepared *scene) {
    ACTIVE(count_of(ray->live));
    COUNT(hard_shadow, test);
    real t = ray->t;
    mask before = less_in(ray->live, t, distance);
    if (!any(before))
        return false;
    ACTIVE(count_of(before));
    COUNT(hard_shadow, step);
    real h = sdf(beam, t, scene, before);
    real hit_distance = set((float)scene->model.march.hit_distance);
    mask going = not_less_in(before, h, least_step(t, hit_distance));
    ray->least = drop(but_not(going, before), ray->least);
    ray->t = t = add_where(going, t, h);
    mask on = not_greater_in(going, beyond(ray->exit, t), set(0.0f));
    return same(on, ray->live) || shade_ends(ray, on, beam);
}

static unsigned lit_packets(const struct lighting light[GROUP]) {
    unsigned packets = 0;
    for (int k = 0; k < GROUP; k++)
        packets |= (unsigned)any(light[k].lit) << k;
    return packets;
}

// The lists of what shadow rays can meet.
static void meet_light(const struct hit hit[GROUP], const struct lighting light[GROUP],
                       struct world *world) {
    bool soft = world->scene->model.shadows == SHADOWS_SOFT;
    struct rays rays;
    real length[GROUP];
    for (int k = 0; k < GROUP; k++) {
        rays.origin[k] = hit[k].point;
        rays.direction[k] = light[k].to_light;
        rays.active[k] = light[k].lit;
        length[k] = light[k].distance;
    }
    meet(&rays, soft ? NULL : length, soft ? UNION : HIT, world, world->own->shadow);
}

void shadow(const struct hit hit[GROUP], const struct lighting light[GROUP], struct world *world,
            real reach[GROUP]) {
    const struct prepared *scene = world->scene;
    bool soft = scene->model.shadows == SHADOWS_SOFT;
    struct shade rays[GROUP];
    unsigned going = scene->model.shadows == SHADOWS_NONE ? 0 : lit_packets(light);
    if (going)
        meet_light(hit, light, world);
    for (int k = 0; k < GROUP; k++) {
        rays[k].least = set(1.0f);
        if (!(going >> k & 1))
            continue;
        ACTIVE(count_of(light[k].lit));
        COUNT(shadow, call);
        approach_origins(hit[k].point, scene, &world->beam[k]);
        approach_directions(light[k].to_light, scene, &world->beam[k]);
        rays[k].exit = leaving(hit[k].point, light[k].to_light, &scene->model);
        rays[k].live = light[k].lit;
        struct beam *beam = &world->beam[k];
        beam->high = choose(light[k].lit, beam->high, set(-INFINITY));
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
                i++;
            else
                list[i] = list[--count];
        }
    for (int k = 0; k < GROUP; k++)
        reach[k] = rays[k].least;
}
