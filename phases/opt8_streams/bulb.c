// Camera rays that may meet a Mandelbulb: all of a tile's in one stream (pool.h), before its patches are shaded.
#include "bounds.h"
#include "pool.h"

// Of rays of unit length those that come near the ball of one; what float makes of |v|² − (v·d)² is 2^-20 of it at most.
// `out`: where the last of the balls is behind them.
static mask meets_bulbs(struct vec direction, mask active, const struct world *world, real *out) {
    COUNT(meets_bulbs, call);
    mask meets = no_lane();
    *out = set(0.0f);
    for (int i = 0; i < world->scene->model.shape_count; i++) {
        const struct placed *s = &world->scene->placed[i];
        if (s->type != SHAPE_MANDELBULB)
            continue;
        if (s->repeated) {
            *out = set(INFINITY);
            return active;
        }
        ACTIVE(count_of(active));
        COUNT(meets_bulbs, bulb);
        COUNT(meets_bulbs, scalar);
        struct vec v = place_sub(world->eye, s->position, s->position_lo);
        real along = vec_dot(v, direction), square = vec_dot(v, v);
        real room = mul_add(square, set(0x1p-20f), set(s->a * s->a));
        mask towards = either(less(along, set(0.0f)), less(square, room));
        real half_sq = mul_add(along, along, room - square);
        meets = either(meets, both(towards, not_less(half_sq, set(0.0f))));
        *out = most_of(root(most_of(half_sq, set(0.0f))) - along, *out);
    }
    return both(active, meets);
}

void gaze(struct vec direction, mask active, int slot, struct world *world) {
    struct desk *desk = world->desk;
    real out, zero = set(0.0f);
    mask meets = meets_bulbs(direction, active, world, &out);
    unload(zero, &desk->marched[MARCHED_T][slot]);
    unload(zero, &desk->marched[MARCHED_LAST][slot]);
    unload(zero, &desk->marched[MARCHED_EVALS][slot]);
    unload(choose(meets, set(0.0f), set(-1.0f)), &desk->marched[MARCHED_FOUND][slot]);
    if (!any(meets))
        return;
    desk->gaze_at[desk->gazes] = slot;
    desk->gaze_active[desk->gazes++] = bits(meets);
    unload(direction.x, &desk->gaze[0][slot]);
    unload(direction.y, &desk->gaze[1][slot]);
    unload(direction.z, &desk->gaze[2][slot]);
}

bool ready_gaze(struct stream *stream, int number, struct world *world) {
    struct desk *desk = world->desk;
    int slot = desk->gaze_at[number];
    struct vec direction = {load(&desk->gaze[0][slot]), load(&desk->gaze[1][slot]),
                            load(&desk->gaze[2][slot])};
    mask waiting = lanes_of(desk->gaze_active[number]);
    ACTIVE(count_of(waiting));
    COUNT(ready_gaze, call);
    stream->beam = eye_of(world->own, world->scene);
    approach_origins(world->eye, world->scene, &stream->beam);
    approach_directions(direction, world->scene, &stream->beam);
    stream->ready.shade.exit = leaving(world->eye, direction, &world->scene->model);
    stream->ready.evals = stream->t = set(0.0f);
    stream->ready.ray = lane_numbers() + set((float)slot);
    meets_bulbs(direction, all_lanes(), world, &stream->ready.length);
    make_ready(stream, waiting, world->scene);
    return true;
}

// For recall().
void arrive(const struct pool *pool, mask ended, real t, struct desk *desk) {
    float values[MARCHED][LANES], ray[LANES];
    unload(t, values[MARCHED_T]);
    unload(keep(pool->found, pool->last), values[MARCHED_LAST]);
    unload(pool->evals, values[MARCHED_EVALS]);
    unload(choose(pool->passed, set(-1.0f), keep(pool->found, set(1.0f))), values[MARCHED_FOUND]);
    unload(pool->ray, ray);
    for (unsigned rest = bits(ended); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest), at = (int)ray[lane];
        for (int i = 0; i < MARCHED; i++)
            desk->marched[i][at] = values[i][lane];
    }
}

// How many lanes are still at work.
static inline int gaze_step(struct pool *pool, int k, real cap, struct world *world) {
    struct group *group = &world->group;
    mask live = group->live[k];
    ACTIVE(count_of(live));
    COUNT(gaze_step, call);
    real t = group->t[k], distance = group->distance[k];
    real hit_distance = set((float)world->scene->model.march.hit_distance);
    mask going = not_less_in(live, distance, least_step(t, hit_distance));
    mask reached = but_not(going, live);
    group->t[k] = t = add_where(going, t, distance);
    pool->last = choose(reached, distance, pool->last);
    pool->evals = add_where(live, pool->evals, set(1.0f));
    mask inside = not_greater_in(going, beyond(pool->shade.exit, t), set(0.0f));
    inside = less_in(inside, pool->evals, cap);
    mask on = not_greater_in(inside, t, pool->length);
    pool->found = either(pool->found, reached);
    pool->passed = either(pool->passed, but_not(on, inside));
    group->live[k] = on;
    group->high[k] = choose(on, group->high[k], set(-INFINITY));
    return __builtin_popcount(bits(on));
}

void march_gazes(struct world *world) {
    struct group *group = &world->group;
    struct stream stream;
    stream_begin(&stream, world->desk->gazes, false, world);
    real cap = set((float)step_cap(&world->scene->model));
    for (int live; (live = refill(&stream, world)) > 0;) {
        struct alone alone = {.shape = -1}; // rays that are filled in bring wakes of their own
        for (int least = enough(&stream, live); live > least;) {
            scene_distances(group, world->scene, &alone);
            live = 0;
            for (int i = 0; i < group->count; i++) {
                int k = group->list[i];
                live += gaze_step(&stream.pool[k], k, cap, world);
            }
        }
    }
    world->desk->gazes = 0;
}
