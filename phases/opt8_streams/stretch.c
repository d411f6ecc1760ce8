// Shadow rays where there is a Mandelbulb. Its estimate costs more than all else, and most of a ray's way leads where a
// plane is nearer than any Mandelbulb can be. So a ray goes among the other shapes, in packets, to the stretch where one
// may be the nearest; through that in a stream (pool.h); and behind it as before. Its steps are the same: what is left
// out is further than what is returned.
#include "bounds.h"
#include "bulb.h"
#include "pool.h"

struct stretch {
    real from, to; // from > to: none
};

// Where |origin + t·direction| < radius + t·slope; never narrower than that. Near to a slope of 1: everywhere.
// `along`: origin·direction; `square`: |origin|².
static struct stretch within_line(real along, real square, real radius, real slope) {
    COUNT(within_line, call);
    real none = set(INFINITY), zero = set(0.0f);
    real lead = neg_mul_add(slope, slope, set(1.0f));
    real half = mul_sub(radius, slope, along);
    real rest = neg_mul_add(radius, radius, square);
    real inner = neg_mul_add(lead, rest, half * half);
    inner = mul_add(set(0x1p-20f), mul_add(half, half, absolute(rest)),
                    inner); // what float makes of it
    real side = root(most_of(inner, zero)), per = set(1.0f) / lead;
    real from = (half - side) * per, to = (half + side) * per;
    mask some = both(not_less(inner, zero), not_less(to, zero));
    mask narrow = greater(lead, set(0x1p-6f));
    from = choose(some, from, none);
    to = choose(some, to, -none);
    return (struct stretch){choose(narrow, from, -none), choose(narrow, to, none)};
}

// Where the Mandelbulb may be nearer than the plane: its estimate is at least half of the distance to its ball, and above
// the tangent of its form from afar.
static struct stretch before_plane(const struct approach *bulb, const struct approach *plane,
                                   const struct placed *placed) {
    COUNT(before_plane, call);
    real height = plane->origin.x, slope = plane->direction.x + set(0x1p-12f);
    height = mul_add(set(0x1p-10f), absolute(height), height + set(0x1p-10f));
    real along = vec_dot(bulb->origin, bulb->direction);
    real square = vec_dot(bulb->origin, bulb->origin);
    real near_radius = mul_add(set(2.0f), height, set(placed->a));
    struct stretch near = within_line(along, square, near_radius, slope + slope);
    struct stretch far = within_line(along, square, height + set(TANGENT), slope);
    return (struct stretch){most_of(near.from, far.from), least_of(near.to, far.to)};
}

static struct stretch stretch_of(const struct beam *beam, const struct prepared *scene) {
    COUNT(stretch_of, call);
    struct stretch all = {set(INFINITY), set(-INFINITY)};
    for (int i = 0; i < scene->model.shape_count; i++) {
        if (scene->placed[i].trust != BALL)
            continue;
        struct stretch one = {set(-INFINITY), set(INFINITY)};
        for (int j = 0; j < scene->model.shape_count && !scene->placed[i].repeated; j++) {
            if (scene->placed[j].way != LINEAR)
                continue;
            COUNT(stretch_of, plane);
            struct stretch here =
                before_plane(&beam->approach[i], &beam->approach[j], &scene->placed[i]);
            one.from = most_of(one.from, here.from);
            one.to = least_of(one.to, here.to);
        }
        COUNT(stretch_of, bulb);
        mask some = not_less(one.to, one.from);
        all.from = choose(some, least_of(all.from, one.from), all.from);
        all.to = choose(some, most_of(all.to, one.to), all.to);
    }
    return all;
}

// The shadow rays from `first` on, of the desk's queue.
static mask queued(int first, struct desk *desk, struct place *origin, struct vec *to_light) {
    float (*field)[ROOM] = desk->shadow;
    *origin = (struct place){load_vec(field + S_HI, first), load_vec(field + S_LO, first)};
    *to_light = load_vec(field + S_TO_LIGHT, first);
    return lanes_before(desk->shadows - first);
}

// Four packets that go together among the other shapes.
struct walk {
    struct shade shade[GROUP];
    real evals[GROUP], length[GROUP], until[GROUP];
    mask there[GROUP]; // rays that have come as far
};

static void begin_walk(struct walk *walk, int k, int first, bool before, struct list others,
                       struct world *world) {
    COUNT(begin_walk, call);
    struct desk *desk = world->desk;
    struct group *group = &world->group;
    struct beam *beam = &group->beam[k];
    struct place origin;
    struct vec to_light;
    mask active = queued(first, desk, &origin, &to_light);
    if (!before)
        active = lanes_of(desk->under_way[first / LANES]);
    walk->there[k] = group->live[k] = no_lane();
    beam->list = before ? world->scene->all : others;
    if (any(active)) {
        ACTIVE(count_of(active));
        COUNT(begin_walk, packet);
        approach_origins(origin, world->scene, beam);
        approach_directions(to_light, world->scene, beam);
        walk->shade[k].exit = leaving(origin, to_light, &world->scene->model);
        walk->length[k] = load(&desk->shadow[S_DISTANCE][first]);
        walk->until[k] = set(INFINITY);
        if (before) {
            struct stretch stretch = stretch_of(beam, world->scene);
            walk->until[k] = stretch.from;
            unload(stretch.to, &desk->leg[LEG_END][first]);
        }
        group->t[k] = load(&desk->leg[LEG_T][first]);
        walk->shade[k].least_sq = load(&desk->leg[LEG_LEAST_SQ][first]);
        walk->shade[k].twice_previous = load(&desk->leg[LEG_TWICE][first]);
        walk->evals[k] = load(&desk->leg[LEG_EVALS][first]);
        group->live[k] = less_in(active, group->t[k], walk->until[k]);
        walk->there[k] = but_not(group->live[k], active);
    }
    beam->list = others;
}

// False after the packet's last step.
static inline bool walk_step(struct walk *walk, int k, float strength_sq, real cap,
                             struct world *world) {
    struct group *group = &world->group;
    const struct model *model = &world->scene->model;
    mask live = group->live[k];
    ACTIVE(count_of(live));
    COUNT(walk_step, call);
    walk->evals[k] = add_where(live, walk->evals[k], set(1.0f));
    mask on = model->shadows == SHADOWS_SOFT
                  ? soft_step(&walk->shade[k], k, strength_sq, group, model)
                  : hard_step(&walk->shade[k], walk->length[k], k, group, model);
    on = less_in(on, walk->evals[k], cap);
    mask before = less_in(on, group->t[k], walk->until[k]);
    if (same(before, live))
        return true;
    walk->there[k] = either(walk->there[k], but_not(before, on));
    return shade_ends(k, before, group);
}

// What scene_distances() finds where nothing but a plane is left.
static inline void plane_distances(struct group *group, const struct placed *plane) {
    COUNT(plane_distances, call);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(count_of(group->live[k]));
        COUNT(plane_distances, packet);
        const struct approach *a = &group->beam[k].approach[(int)plane->index];
        group->distance[k] = mul_add(a->direction.x, group->t[k], a->origin.x);
    }
}

// Four packets of the queue, as far as the stretch, or from behind it on.
static void walk_among(int first, bool before, struct list others, struct world *world) {
    COUNT(walk_among, call);
    struct group *group = &world->group;
    struct desk *desk = world->desk;
    const struct model *model = &world->scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    real cap = set((float)step_cap(model));
    struct walk walk;
    for (int k = 0; k < GROUP; k++)
        begin_walk(&walk, k, first + k * LANES, before, others, world);
    set_out(group);
    unsigned begun = 0;
    for (int i = 0; i < group->count; i++)
        begun |= 1u << group->list[i];
    const struct placed *plane = the_one(SHAPE_PLANE, world->scene);
    struct alone alone = {.shape = -1};
    while (group->count > 0) {
        if (world->scene->lone && plane)
            plane_distances(group, plane);
        else
            scene_distances(group, world->scene, &alone);
        for (int i = 0; i < group->count;) {
            if (walk_step(&walk, group->list[i], strength_sq, cap, world))
                i++;
            else
                group->list[i] = group->list[--group->count];
        }
    }
    for (int k = 0; k < GROUP; k++) {
        int at = first + k * LANES;
        desk->under_way[at / LANES] = bits(walk.there[k]);
        if (!(begun >> k & 1))
            continue;
        unload(group->t[k], &desk->leg[LEG_T][at]);
        unload(walk.shade[k].least_sq, &desk->leg[LEG_LEAST_SQ][at]);
        unload(walk.shade[k].twice_previous, &desk->leg[LEG_TWICE][at]);
        unload(walk.evals[k], &desk->leg[LEG_EVALS][at]);
    }
}

// One packet of those that have come to the stretch, to go lane by lane.
bool ready_shadow(struct stream *stream, int number, struct world *world) {
    struct desk *desk = world->desk;
    int first = number * LANES;
    struct place origin;
    struct vec to_light;
    queued(first, desk, &origin, &to_light);
    mask waiting = lanes_of(desk->under_way[number]);
    desk->under_way[number] = 0;
    if (!any(waiting))
        return false;
    ACTIVE(count_of(waiting));
    COUNT(ready_shadow, call);
    stream->beam = eye_of(world->own, world->scene);
    approach_origins(origin, world->scene, &stream->beam);
    approach_directions(to_light, world->scene, &stream->beam);
    stream->ready.shade =
        (struct shade){load(&desk->leg[LEG_LEAST_SQ][first]), load(&desk->leg[LEG_TWICE][first]),
                       leaving(origin, to_light, &world->scene->model)};
    stream->ready.evals = load(&desk->leg[LEG_EVALS][first]);
    stream->ready.length = load(&desk->shadow[S_DISTANCE][first]);
    stream->ready.end = load(&desk->leg[LEG_END][first]);
    stream->ready.ray = lane_numbers() + set((float)first);
    stream->t = load(&desk->leg[LEG_T][first]);
    make_ready(stream, waiting, world->scene);
    return true;
}

void leave(const struct pool *pool, mask ended, real t, struct desk *desk) {
    COUNT(leave, call);
    float values[LEG_END][LANES], ray[LANES];
    unload(t, values[LEG_T]);
    unload(pool->shade.least_sq, values[LEG_LEAST_SQ]);
    unload(pool->shade.twice_previous, values[LEG_TWICE]);
    unload(pool->evals, values[LEG_EVALS]);
    unload(pool->ray, ray);
    for (unsigned rest = bits(ended), passed = bits(pool->passed); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest), at = (int)ray[lane];
        for (int i = 0; i < LEG_END; i++)
            desk->leg[i][at] = values[i][lane];
        desk->under_way[at / LANES] |= (passed >> lane & 1) << at % LANES;
    }
}

// How many lanes are still at work.
static inline int pool_step(struct pool *pool, int k, float strength_sq, real cap,
                            struct world *world) {
    struct group *group = &world->group;
    const struct model *model = &world->scene->model;
    ACTIVE(count_of(group->live[k]));
    COUNT(pool_step, call);
    pool->evals = add_where(group->live[k], pool->evals, set(1.0f));
    mask on = model->shadows == SHADOWS_SOFT
                  ? soft_step(&pool->shade, k, strength_sq, group, model)
                  : hard_step(&pool->shade, pool->length, k, group, model);
    on = less_in(on, pool->evals, cap);
    mask stay = not_greater_in(on, group->t[k], pool->end);
    pool->passed = either(pool->passed, but_not(stay, on));
    group->live[k] = stay;
    group->high[k] = choose(stay, group->high[k], set(-INFINITY));
    return __builtin_popcount(bits(stay));
}

// What scene_distances() finds where a Mandelbulb is alone: nobody asks which shape is awake.
static inline void lone_distances(struct group *group, const struct placed *bulb,
                                  const struct placed *plane) {
    COUNT(lone_distances, call);
    struct orbit b[GROUP];
    struct vec p[GROUP];
    int i = (int)bulb->index;
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(count_of(group->live[k]));
        COUNT(lone_distances, packet);
        const struct approach *a = &group->beam[k].approach[i];
        p[k] = vec_along(a->origin, a->direction, group->t[k]);
        bulb_begin(&b[k], p[k], group->live[k]);
    }
    bulbs_end(bulb, 0, false, false, false, GROUP, b, p, group->distance);
    for (int k = 0; plane && k < GROUP; k++) {
        ACTIVE(count_of(group->live[k]));
        COUNT(lone_distances, plane);
        const struct approach *a = &group->beam[k].approach[(int)plane->index];
        real height = mul_add(a->direction.x, group->t[k], a->origin.x);
        group->distance[k] = least_of(group->distance[k], height);
    }
}

static void through_stretches(struct world *world) {
    COUNT(through_stretches, call);
    struct group *group = &world->group;
    const struct model *model = &world->scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct stream stream;
    stream_begin(&stream, (world->desk->shadows + LANES - 1) / LANES, true, world);
    real cap = set((float)step_cap(model));
    const struct placed *bulb = the_one(SHAPE_MANDELBULB, world->scene);
    const struct placed *plane = the_one(SHAPE_PLANE, world->scene);
    for (int live; (live = refill(&stream, world)) > 0;) {
        struct alone alone = {.shape = -1}; // rays that are filled in bring wakes of their own
        for (int least = enough(&stream, live); live > least;) {
            if (world->scene->lone)
                lone_distances(group, bulb, plane);
            else
                scene_distances(group, world->scene, &alone);
            live = 0;
            for (int i = 0; i < group->count; i++) {
                int k = group->list[i];
                live += pool_step(&stream.pool[k], k, strength_sq, cap, world);
            }
        }
    }
}

// As all rays begin.
static void begin_legs(struct world *world) {
    struct desk *desk = world->desk;
    real start = set((float)world->scene->model.march.surface_offset);
    for (int first = 0; first < desk->shadows; first += LANES) {
        unload(start, &desk->leg[LEG_T][first]);
        unload(set(1.0f), &desk->leg[LEG_LEAST_SQ][first]);
        // its square, times t's and the strength's, is a float
        unload(set(1e14f), &desk->leg[LEG_TWICE][first]);
        unload(set(0.0f), &desk->leg[LEG_EVALS][first]);
    }
}

void cast_streams(struct world *world) {
    COUNT(cast_streams, call);
    struct desk *desk = world->desk;
    struct list others = list_of_others(world->scene, world->own);
    begin_legs(world);
    for (int first = 0; first < desk->shadows; first += TOGETHER)
        walk_among(first, true, others, world);
    through_stretches(world);
    for (int first = 0; first < desk->shadows; first += TOGETHER)
        walk_among(first, false, others, world);
    for (int first = 0; first < desk->shadows; first += LANES) {
        mask there = lanes_before(desk->shadows - first);
        ACTIVE(count_of(there));
        COUNT(cast_streams, packet);
        real reach = root(load(&desk->leg[LEG_LEAST_SQ][first]));
        struct vec light = vec_scale(load_vec(desk->shadow + S_LIGHT, first), reach);
        add_light(there, light, load(&desk->shadow[S_PIXEL][first]), desk);
    }
}
