// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). A packet of rays marches until the last is done.
#include "rods.h"
#include "simd/point.h"

// A ray leaves the bounds when |o + t·d|² > radius²: a polynomial in t, free of the point itself, and
// known to a few 2^-24 of radius²: within 2^-20 the ray goes on, and its hit is asked by within().
struct exit {
    vfloat linear, constant; // t·(t + linear) + constant > 0
};

static struct exit leaving(struct point origin, struct vec direction, const struct model *model) {
    COUNT(leaving, call);
    COUNT(leaving, scalar);
    float radius = (float)model->march.bounds_radius;
    struct vec o = origin.hi;
    return (struct exit){v_splat(2.0f) * vec_dot(o, direction),
                         vec_dot(o, o) - v_splat(radius * radius * (1.0f + 0x1p-20f))};
}

static vmask within(struct point place, const struct model *model) {
    COUNT(within, call);
    COUNT(within, scalar);
    double radius = model->march.bounds_radius;
    return v_cmp_ge(v_splat(0.0f), power_at(vec_double_of(place), radius * radius));
}

static inline vfloat beyond(struct exit exit, vfloat t) { // > 0: outside
    return v_madd(t, t + exit.linear, exit.constant);
}

// The hit test that float can keep: below half an ulp of t, 2^-24·t at the most, a step no longer
// moves the ray, and it would stall there until the step cap.
static inline vfloat least_step(vfloat t, vfloat hit_distance) {
    return v_max(hit_distance, t * v_splat(0x1p-24f));
}

// Newton's last step: more than h is left to go where a ray grazes, 33 times on scene0's plane at the
// horizon. Only for what float's march may err by: what a larger hit_distance leaves is the scene's.
static inline vfloat newton(vfloat h, vfloat slope, vfloat way) {
    COUNT(newton, call);
    vmask own = v_cmp_lt(v_abs(h), way * v_splat(0x1p-21f));
    return v_select_or_zero(own, h / v_max(slope, v_splat(0x1p-9f)));
}

// Where the rays of a packet are: at the distance before + t + last. t and the last step apart: their
// sum, rounded, would lose what places the hit on the surface.
struct progress {
    struct point origin; // at the distance `before`
    vfloat before, t, last, evals;
    vfloat start; // where the first march begins
    int cap;      // of its evaluations
    vmask found;
    struct exit exit;
    int left;   // steps that every ray has before its cap
    vmask deep; // a ray that started inside a shape has stepped back out of it
    vfloat inside;
    struct nearness near;
};

// More counts of steps a float cannot hold; a ray that was asked for more ends here as at the cap.
enum { MOST_STEPS = 1 << 24 };

int step_cap(const struct model *model) {
    return model->march.max_steps < MOST_STEPS ? model->march.max_steps : MOST_STEPS;
}

// Rays that march on from a hit have had some of their evaluations.
static int steps_left(const struct progress *at, vmask live) {
    float evals[LANES];
    v_store(v_select_or_zero(live, at->evals), evals);
    int had = 0;
    for (int lane = 0; lane < LANES; lane++)
        had = (int)evals[lane] > had ? (int)evals[lane] : had;
    return at->cap - had;
}

// Some rays have ended: those that have reached a surface, and others. Each has a cap of its own, whatever its
// neighbours had.
__attribute__((noinline)) static void march_ends(struct progress *at, int step, int k, vmask going,
                                                 vmask inside, struct group *group) {
    COUNT(march_ends, call);
    vmask live = group->live[k], reached = v_andnot(going, live);
    at->last = v_select(reached, group->distance[k], at->last);
    at->found = v_or(at->found, reached);
    vfloat evals = at->evals + v_splat((float)step);
    if (step >= at->left) {
        COUNT(march_ends, cap);
        inside = v_cmp_lt_in(inside, evals, v_splat((float)at->cap));
    }
    at->evals = v_select(v_andnot(inside, live), evals, at->evals);
    group->live[k] = inside;
    group->high[k] = v_select(inside, group->high[k], v_splat(-INFINITY));
}

// The packets that have a live ray, and what of a ray that has none would wake a shape.
static void set_out(struct group *group) {
    group->count = 0;
    for (int k = 0; k < GROUP; k++) {
        group->high[k] = v_select(group->live[k], group->beam[k].high, v_splat(-INFINITY));
        if (v_any(group->live[k]))
            group->list[group->count++] = k;
        else
            group->t[k] = v_splat(0.0f);
    }
}

// The step-th step of a packet, its distance known. False after the last.
static inline bool march_step(struct progress *at, int step, int k, struct group *group,
                              const struct model *model) {
    vmask live = group->live[k];
    ACTIVE(v_count(live));
    COUNT(march_step, call);
    vfloat t = group->t[k], distance = group->distance[k];
    vmask going =
        v_cmp_nlt_in(live, distance, least_step(t, v_splat((float)model->march.hit_distance)));
    group->t[k] = t = v_add_where(going, t, distance);
    vmask inside = v_cmp_ngt_in(going, beyond(at->exit, t), v_splat(0.0f));
    if (v_same(inside, live) && step < at->left)
        return true;
    march_ends(at, step, k, going, inside, group);
    return v_any(group->live[k]);
}

// Until every ray has ended, by the hit test of a float march, which errs with t.
static void march(struct progress packets[GROUP], const struct rays *rays, struct world *world) {
    COUNT(march, call);
    const struct prepared *scene = world->scene;
    struct group *group = &world->group;
    set_out(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(v_count(group->live[k]));
        struct progress *at = &packets[k];
        at->exit = leaving(at->origin, rays->direction[k], &scene->model);
        at->left = steps_left(at, group->live[k]);
        group->t[k] = v_select(group->live[k], at->start, at->t); // what is done stays where it is
        at->start = v_splat(0.0f);
        at->last = v_zero_where(group->live[k], at->last);
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
__attribute__((noinline)) static void stay_in(vmask deep, vfloat t, const struct prepared *scene,
                                              const struct approach *approach, vfloat *shape) {
    ACTIVE(v_count(deep));
    COUNT(stay_in, call);
    vfloat inside = v_splat(-1.0f);
    nearest_shape(approach, t, scene, deep, &inside);
    *shape = v_select(deep, inside, *shape);
}

// Each hit becomes an origin, in the frames of all shapes: there the distance is exact to the size of
// a shape, not of the way to it. A hit that is still further than twice the hit distance, because
// the march erred or its test was wider than the scene's, marches on from there: whether there is one.
static bool landed(struct progress *at, vmask settled, struct vec direction,
                   const struct prepared *scene, struct beam *beam, vmask *live) {
    ACTIVE(v_count(at->found));
    COUNT(landed, call);
    if (!v_any(at->found))
        return false;
    COUNT(landed, point);
    COUNT(landed, scalar);
    float twice = 2.0f * (float)scene->model.march.hit_distance;
    vmask sunk = v_and(v_andnot(settled, at->found), v_cmp_lt(at->last, v_splat(-twice)));
    if (v_any(sunk))
        stay_in(sunk, at->t, scene, beam->approach, &at->inside);
    at->deep = v_or(at->deep, sunk);
    // What has settled stays as it is to the bit, whatever its neighbours do.
    at->origin =
        point_select(settled, at->origin, point_at(at->origin, direction, at->t, at->last));
    approach_origins(at->origin, scene, beam);
    at->near = near_hit(at->found, scene, beam);
    vmask off = v_and(
        at->found, v_andnot(v_or(at->deep, settled), v_cmp_gt(at->near.distance, v_splat(twice))));
    if (!v_any(off))
        return false;
    ACTIVE(v_count(off));
    COUNT(landed, on);
    // From where it surely was before that surface, be it as thin as an ulp of t.
    vfloat back = v_select_or_zero(off, at->t * v_splat(-0x1p-22f));
    at->origin.lo = vec_along(at->origin.lo, direction, back);
    at->before = v_select(off, at->before + (at->t + (at->last + back)), at->before);
    approach_origins(at->origin, scene, beam);
    approach_directions(direction, scene, beam->approach);
    at->found = v_andnot(off, at->found);
    *live = v_cmp_lt_in(off, at->evals, v_splat((float)at->cap));
    return v_any(*live);
}

static struct hit hit_of(struct progress *at, struct vec direction, const struct prepared *scene,
                         struct beam *beam) {
    COUNT(hit_of, call);
    struct hit hit = {.found = at->found, .shape = v_splat(-1.0f), .evals = at->evals};
    if (!v_any(at->found))
        return hit;
    vfloat way = at->before + at->t;
    vmask unmoved = v_cmp_ge(v_splat(0.0f), way); // hits wherever it starts
    hit.found = v_and(hit.found, v_or(within(at->origin, &scene->model), unmoved));
    struct nearness near = at->near;
    if (v_any(at->deep)) {
        COUNT(hit_of, deep);
        vmask other = v_cmp_ge(v_abs(near.shape - at->inside), v_splat(0.5f));
        near.contact = v_or(near.contact, v_and(at->deep, other));
        near.shape = v_select(at->deep, at->inside, near.shape);
    }
    vfloat slope;
    hit.normal = normal_at(direction, hit.found, &near, scene, beam->approach, &slope);
    ACTIVE(v_count(hit.found));
    COUNT(hit_of, end);
    hit.shape = v_select(hit.found, near.shape, hit.shape);
    vfloat more = v_zero_where(at->deep, newton(near.distance, slope, way));
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
        ACTIVE(v_count(rays->active[k]));
        vfloat zero = v_splat(0.0f);
        packets[k] = (struct progress){.origin = rays->origin[k]};
        packets[k].before = packets[k].t = packets[k].last = packets[k].evals = zero;
        packets[k].start = rays->start[k];
        packets[k].cap = rays->cap;
        packets[k].found = packets[k].deep = v_mask_none();
        packets[k].inside = v_splat(-1.0f);
        world->group.live[k] = rays->active[k];
        if (!v_any(rays->active[k]))
            continue;
        going |= 1u << k;
        approach_origins(rays->origin[k], scene, &world->group.beam[k]);
        approach_directions(rays->direction[k], scene, world->group.beam[k].approach);
    }
    while (going) {
        vmask settled[GROUP];
        for (int k = 0; k < GROUP; k++)
            settled[k] = packets[k].found;
        march(packets, rays, world);
        for (int k = 0; k < GROUP; k++)
            if (going >> k & 1 && !landed(&packets[k], settled[k], rays->direction[k], scene,
                                          &world->group.beam[k], &world->group.live[k]))
                going &= ~(1u << k);
    }
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(v_count(packets[k].found));
        hit[k] = hit_of(&packets[k], rays->direction[k], scene, &world->group.beam[k]);
    }
}

// Rays to the light.
struct shade {
    vfloat least_sq; // of the light so far: the root is taken once, of what is left in the end
    vfloat twice_previous;
    struct exit exit;
};

// The rays that are still under way, after some have ended.
__attribute__((noinline)) static bool shade_ends(int k, vmask live, struct group *group) {
    group->live[k] = live;
    group->high[k] = v_select(live, group->high[k], v_splat(-INFINITY));
    return v_any(live);
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds. False after the
// packet's last step.
static inline bool soft_step(struct shade *ray, int k, float strength_sq, struct group *group,
                             const struct model *model) {
    vmask live = group->live[k];
    ACTIVE(v_count(live));
    COUNT(soft_step, call);
    vfloat t = group->t[k], h = group->distance[k], zero = v_splat(0.0f);
    vmask going = v_cmp_nlt_in(live, h, least_step(t, v_splat((float)model->march.hit_distance)));
    if (!v_any(going))
        return shade_ends(k, going, group);
    ACTIVE(v_count(going));
    COUNT(soft_step, step);
    // y = h²/(2·previous); inside = h² − y², past = t − y. Asked without a division: both times 2·previous.
    vfloat twice = ray->twice_previous;
    vfloat square = h * h, scale = twice * twice, inside = scale - square;
    vfloat past = v_msub(twice, t, square);
    // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
    // In float it is noise wherever inside/h² is of the order of h's own error, 1e-5 at least.
    vmask sound = v_cmp_lt_in(v_cmp_lt_in(going, scale * v_splat(2e-5f), inside), zero, past);
    // (strength·h·√inside/past)² < least², asked without the division: it is seldom so.
    vfloat term = v_splat(strength_sq) * square * inside, per = past * past;
    vmask darker = v_cmp_lt_in(sound, term, ray->least_sq * per);
    if (v_any(darker)) {
        ACTIVE(v_count(darker));
        COUNT(soft_step, darker);
        ray->least_sq = v_select(darker, term / past / past, ray->least_sq); // past² may overflow
    }
    ray->twice_previous = h + h;
    group->t[k] = t = v_add_where(going, t, h);
    vmask on = v_cmp_ngt_in(going, beyond(ray->exit, t), zero);
    return v_same(on, live) || shade_ends(k, on, group);
}

static inline bool hard_step(struct shade *ray, vfloat distance, int k, struct group *group,
                             const struct model *model) {
    // Past the light a ray is lit, and has taken one evaluation too many.
    ACTIVE(v_count(group->live[k]));
    COUNT(hard_step, call);
    vfloat t = group->t[k], h = group->distance[k];
    vmask live = group->live[k], before = v_cmp_lt_in(live, t, distance);
    vmask going = v_cmp_nlt_in(before, h, least_step(t, v_splat((float)model->march.hit_distance)));
    ray->least_sq = v_zero_where(v_andnot(going, before), ray->least_sq);
    group->t[k] = t = v_add_where(going, t, h);
    vmask on = v_cmp_ngt_in(going, beyond(ray->exit, t), v_splat(0.0f));
    return v_same(on, live) || shade_ends(k, on, group);
}

void shadow(const struct hit hit[GROUP], const struct lighting light[GROUP], struct world *world,
            vfloat reach[GROUP]) {
    COUNT(shadow, call);
    COUNT(shadow, scalar);
    const struct model *model = &world->scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct group *group = &world->group;
    bool soft = model->shadows == SHADOWS_SOFT;
    struct shade rays[GROUP];
    for (int k = 0; k < GROUP; k++) {
        rays[k].least_sq = v_splat(1.0f);
        group->live[k] = model->shadows == SHADOWS_NONE ? v_mask_none() : light[k].lit;
    }
    set_out(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(v_count(light[k].lit));
        approach_directions(light[k].to_light, world->scene, group->beam[k].approach);
        rays[k].exit = leaving(hit[k].point, light[k].to_light, model);
        rays[k].twice_previous =
            v_splat(1e14f); // its square, times t's and the strength's, is a float
        group->t[k] = v_splat((float)model->march.surface_offset);
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
        ACTIVE(v_count(light[k].lit));
        COUNT(shadow, end);
        reach[k] = v_sqrt(rays[k].least_sq);
    }
}
