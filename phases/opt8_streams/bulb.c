// Camera rays that may meet a Mandelbulb: all of a tile's in one stream (pool.h), before its patches are shaded.
#include "bounds.h"
#include "pool.h"

void gaze(struct vec direction, mask active, int slot, struct desk *desk) {
    desk->gaze_at[desk->gazes] = slot;
    desk->gaze_active[desk->gazes++] = bits(active);
    unload(direction.x, &desk->gaze[0][slot]);
    unload(direction.y, &desk->gaze[1][slot]);
    unload(direction.z, &desk->gaze[2][slot]);
}

void ready_gaze(struct stream *stream, int number, struct world *world) {
    struct desk *desk = world->desk;
    int slot = desk->gaze_at[number];
    struct vec direction = {load(&desk->gaze[0][slot]), load(&desk->gaze[1][slot]),
                            load(&desk->gaze[2][slot])};
    stream->waiting = desk->gaze_active[number];
    ACTIVE(__builtin_popcount(stream->waiting));
    COUNT(ready_gaze, call);
    stream->beam = eye_of(world->own, world->scene);
    approach_origins(world->eye, world->scene, &stream->beam);
    approach_directions(direction, world->scene, &stream->beam);
    stream->ready.shade.exit = leaving(world->eye, direction, &world->scene->model);
    stream->ready.evals = stream->t = set(0.0f);
    for (int lane = 0; lane < LANES; lane++)
        stream->ready.ray[lane] = slot + lane;
}

// What has ended of a packet leaves where it is for recall().
static void arrive(const struct pool *pool, mask ended, mask reached, real t, real distance,
                   struct desk *desk) {
    float values[MARCHED][LANES];
    unload(t, values[MARCHED_T]);
    unload(keep(reached, distance), values[MARCHED_LAST]);
    unload(pool->evals, values[MARCHED_EVALS]);
    unload(keep(reached, set(1.0f)), values[MARCHED_FOUND]);
    for (unsigned rest = bits(ended); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest);
        for (int i = 0; i < MARCHED; i++)
            desk->marched[i][pool->ray[lane]] = values[i][lane];
    }
}

static inline void gaze_step(struct pool *pool, int k, real cap, struct world *world) {
    struct group *group = &world->group;
    mask live = group->live[k];
    ACTIVE(count_of(live));
    COUNT(gaze_step, call);
    real t = group->t[k], distance = group->distance[k];
    real hit_distance = set((float)world->scene->model.march.hit_distance);
    mask going = not_less_in(live, distance, least_step(t, hit_distance));
    group->t[k] = t = add_where(going, t, distance);
    pool->evals = pool->evals + set(1.0f);
    mask inside = not_greater_in(going, beyond(pool->shade.exit, t), set(0.0f));
    inside = less_in(inside, pool->evals, cap);
    if (same(inside, live))
        return;
    arrive(pool, but_not(inside, live), but_not(going, live), t, distance, world->desk);
    group->live[k] = inside;
    group->high[k] = choose(inside, group->high[k], set(-INFINITY));
}

void march_gazes(struct world *world) {
    struct group *group = &world->group;
    struct stream stream;
    stream_begin(&stream, world->desk->gazes, false, world);
    real cap = set((float)step_cap(&world->scene->model));
    for (int live; (live = refill(&stream, world)) > 0;) {
        for (int least = enough(&stream, live); live > least;) {
            scene_distances(group, world->scene);
            live = 0;
            for (int i = 0; i < group->count; i++) {
                int k = group->list[i];
                gaze_step(&stream.pool[k], k, cap, world);
                live += __builtin_popcount(bits(group->live[k]));
            }
        }
    }
    world->desk->gazes = 0;
}
