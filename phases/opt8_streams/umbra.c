// Shadow rays that wait, in packets: see streams.h. Each of them marches until its last ray is done.
#include "bounds.h"
#include "pool.h"

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
    // strength·√inside/past < least, asked without the root: it is seldom so.
    real wanted = ray->least * past;
    mask darker = less_in(sound, set(strength_sq) * square * inside, wanted * wanted);
    if (any(darker)) {
        ACTIVE(count_of(darker));
        COUNT(soft_step, darker);
        ray->least = choose(darker, set((float)model->shadow_strength) * h * root(inside) / past,
                            ray->least);
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
    ray->least = drop(but_not(going, before), ray->least);
    group->t[k] = t = add_where(going, t, h);
    mask on = not_greater_in(going, beyond(ray->exit, t), set(0.0f));
    return same(on, live) || shade_ends(k, on, group);
}

static void wait_for(struct rays *rays, real length[GROUP], int first, struct desk *desk) {
    COUNT(wait_for, call);
    float (*field)[ROOM] = desk->shadow;
    for (int k = 0; k < GROUP; k++, first += LANES) {
        rays->origin[k] =
            (struct place){load_vec(field + S_HI, first), load_vec(field + S_LO, first)};
        rays->direction[k] = load_vec(field + S_TO_LIGHT, first);
        COUNT(wait_for, packet);
        rays->active[k] = lanes_before(desk->shadows - first);
        length[k] = load(&field[S_DISTANCE][first]);
    }
}

// 1: the light reaches the point, 0: it does not; between, the penumbra of a soft shadow.
static void shadow(const struct rays *rays, const real length[GROUP], struct world *world,
                   real reach[GROUP]) {
    COUNT(shadow, call);
    COUNT(shadow, scalar);
    const struct prepared *scene = world->scene;
    const struct model *model = &scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct group *group = &world->group;
    bool soft = model->shadows == SHADOWS_SOFT;
    struct shade shades[GROUP];
    meet(rays, soft ? NULL : length, soft ? UNION : HIT, world, world->own->shadow);
    for (int k = 0; k < GROUP; k++) {
        shades[k].least = set(1.0f);
        group->live[k] = rays->active[k];
        if (any(rays->active[k]))
            approach_origins(rays->origin[k], scene, &group->beam[k]);
    }
    set_out(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(count_of(rays->active[k]));
        approach_directions(rays->direction[k], scene, &group->beam[k]);
        shades[k].exit = leaving(rays->origin[k], rays->direction[k], model);
        shades[k].twice_previous =
            set(1e14f); // its square, times t's and the strength's, is a float
        group->t[k] = set((float)model->march.surface_offset);
    }
    for (int step = 0; group->count > 0 && step < model->march.max_steps; step++) {
        scene_distances(group, scene);
        for (int i = 0; i < group->count;) {
            int k = group->list[i];
            if (soft ? soft_step(&shades[k], k, strength_sq, group, model)
                     : hard_step(&shades[k], length[k], k, group, model))
                i++;
            else
                group->list[i] = group->list[--group->count];
        }
    }
    for (int k = 0; k < GROUP; k++)
        reach[k] = shades[k].least;
}

// One packet of them, to go lane by lane.
void ready_shadow(struct stream *stream, int number, struct world *world) {
    struct desk *desk = world->desk;
    const struct model *model = &world->scene->model;
    float (*field)[ROOM] = desk->shadow;
    int first = number * LANES;
    struct place origin = {load_vec(field + S_HI, first), load_vec(field + S_LO, first)};
    struct vec to_light = load_vec(field + S_TO_LIGHT, first);
    stream->waiting = bits(lanes_before(desk->shadows - first));
    ACTIVE(__builtin_popcount(stream->waiting));
    COUNT(ready_shadow, call);
    stream->beam = eye_of(world->own, world->scene);
    approach_origins(origin, world->scene, &stream->beam);
    approach_directions(to_light, world->scene, &stream->beam);
    stream->ready.shade = (struct shade){set(1.0f), set(1e14f), leaving(origin, to_light, model)};
    stream->ready.evals = set(0.0f);
    stream->ready.length = load(&field[S_DISTANCE][first]);
    stream->t = set((float)model->march.surface_offset);
    for (int lane = 0; lane < LANES; lane++)
        stream->ready.ray[lane] = first + lane;
}

// What has ended of a packet adds its light.
static void shine(const struct pool *pool, mask ended, struct desk *desk) {
    COUNT(shine, call);
    float reach[LANES];
    unload(pool->shade.least, reach);
    for (unsigned rest = bits(ended); rest; rest &= rest - 1) {
        COUNT(shine, lane);
        int lane = __builtin_ctz(rest), ray = pool->ray[lane];
        int pixel = (int)desk->shadow[S_PIXEL][ray];
        for (int k = 0; k < 3; k++)
            desk->color[k][pixel] += reach[lane] * desk->shadow[S_LIGHT + k][ray];
    }
}

static inline void pool_step(struct pool *pool, int k, float strength_sq, real cap,
                             struct world *world) {
    struct group *group = &world->group;
    const struct model *model = &world->scene->model;
    mask live = group->live[k];
    ACTIVE(count_of(live));
    COUNT(pool_step, call);
    pool->evals = pool->evals + set(1.0f);
    if (model->shadows == SHADOWS_SOFT)
        soft_step(&pool->shade, k, strength_sq, group, model);
    else
        hard_step(&pool->shade, pool->length, k, group, model);
    mask on = less_in(group->live[k], pool->evals, cap);
    if (same(on, live))
        return;
    shade_ends(k, on, group);
    shine(pool, but_not(on, live), world->desk);
}

static void cast_streams(struct world *world) {
    COUNT(cast_streams, call);
    struct group *group = &world->group;
    const struct model *model = &world->scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct stream stream;
    stream_begin(&stream, (world->desk->shadows + LANES - 1) / LANES, true, world);
    real cap = set((float)step_cap(model));
    for (int live; (live = refill(&stream, world)) > 0;) {
        for (int least = enough(&stream, live); live > least;) {
            scene_distances(group, world->scene);
            live = 0;
            for (int i = 0; i < group->count; i++) {
                int k = group->list[i];
                pool_step(&stream.pool[k], k, strength_sq, cap, world);
                live += __builtin_popcount(bits(group->live[k]));
            }
        }
    }
}

static void cast_packets(struct world *world) {
    COUNT(cast_packets, call);
    struct desk *desk = world->desk;
    for (int first = 0; first < desk->shadows; first += TOGETHER) {
        struct rays rays;
        real length[GROUP], reach[GROUP];
        wait_for(&rays, length, first, desk);
        shadow(&rays, length, world, reach);
        for (int k = 0; k < GROUP; k++) {
            int at = first + k * LANES;
            ACTIVE(count_of(rays.active[k]));
            COUNT(cast_packets, packet);
            struct vec light = vec_scale(load_vec(desk->shadow + S_LIGHT, at), reach[k]);
            add_light(rays.active[k], light, load(&desk->shadow[S_PIXEL][at]), desk);
        }
    }
}

void cast_shadows(struct world *world) {
    COUNT(cast_shadows, call);
    struct desk *desk = world->desk;
    if (world->scene->bulbs > 0)
        cast_streams(world);
    else
        cast_packets(world);
    desk->shadows = 0;
}
