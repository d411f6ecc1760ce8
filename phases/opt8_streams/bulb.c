// Camera rays that may meet a Mandelbulb: all of a tile's in one stream (pool.h), before its patches are shaded.
#include "bounds.h"
#include "pool.h"
#include "simd/point.h"

// Of rays of unit length those that come near the ball of one; what float makes of |v|² − (v·d)² is 2^-20 of it at most.
// `out`: where the last of the balls is behind them.
static vmask meets_bulbs(struct vec direction, vmask active, const struct world *world,
                         vfloat *out) {
    COUNT(meets_bulbs, call);
    vmask meets = v_mask_none();
    *out = v_splat(0.0f);
    for (int i = 0; i < world->scene->model.shape_count; i++) {
        const struct placed *s = &world->scene->placed[i];
        if (s->type != SHAPE_MANDELBULB)
            continue;
        if (s->repeated) {
            *out = v_splat(INFINITY);
            return active;
        }
        ACTIVE(v_count(active));
        COUNT(meets_bulbs, bulb);
        COUNT(meets_bulbs, scalar);
        struct vec v = point_sub(world->eye, s->position, s->position_lo);
        vfloat along = vec_dot(v, direction), square = vec_dot(v, v);
        vfloat room = v_madd(square, v_splat(0x1p-20f), v_splat(s->a * s->a));
        vmask towards = v_or(v_cmp_lt(along, v_splat(0.0f)), v_cmp_lt(square, room));
        vfloat half_sq = v_madd(along, along, room - square);
        meets = v_or(meets, v_and(towards, v_cmp_ge(half_sq, v_splat(0.0f))));
        *out = v_max(v_sqrt(v_max(half_sq, v_splat(0.0f))) - along, *out);
    }
    return v_and(active, meets);
}

void gaze(struct vec direction, vmask active, int slot, struct world *world) {
    struct desk *desk = world->desk;
    vfloat out, zero = v_splat(0.0f);
    vmask meets = meets_bulbs(direction, active, world, &out);
    v_store(zero, &desk->marched[MARCHED_T][slot]);
    v_store(zero, &desk->marched[MARCHED_LAST][slot]);
    v_store(zero, &desk->marched[MARCHED_EVALS][slot]);
    v_store(v_select(meets, v_splat(0.0f), v_splat(-1.0f)), &desk->marched[MARCHED_FOUND][slot]);
    if (!v_any(meets))
        return;
    desk->gaze_at[desk->gazes] = slot;
    desk->gaze_active[desk->gazes++] = v_mask_bits(meets);
    v_store(direction.x, &desk->gaze[0][slot]);
    v_store(direction.y, &desk->gaze[1][slot]);
    v_store(direction.z, &desk->gaze[2][slot]);
}

bool ready_gaze(struct stream *stream, int number, struct world *world) {
    struct desk *desk = world->desk;
    int slot = desk->gaze_at[number];
    struct vec direction = {v_load(&desk->gaze[0][slot]), v_load(&desk->gaze[1][slot]),
                            v_load(&desk->gaze[2][slot])};
    vmask waiting = v_mask_of_bits(desk->gaze_active[number]);
    ACTIVE(v_count(waiting));
    COUNT(ready_gaze, call);
    stream->beam = eye_of(world->own, world->scene);
    approach_origins(world->eye, world->scene, &stream->beam);
    approach_directions(direction, world->scene, &stream->beam);
    stream->ready.shade.exit = leaving(world->eye, direction, &world->scene->model);
    stream->ready.evals = stream->t = v_splat(0.0f);
    stream->ready.ray = v_iota() + v_splat((float)slot);
    meets_bulbs(direction, v_mask_all(), world, &stream->ready.length);
    make_ready(stream, waiting, world->scene);
    return true;
}

// For recall().
void arrive(const struct pool *pool, vmask ended, vfloat t, struct desk *desk) {
    float values[MARCHED][LANES], ray[LANES];
    v_store(t, values[MARCHED_T]);
    v_store(v_select_or_zero(pool->found, pool->last), values[MARCHED_LAST]);
    v_store(pool->evals, values[MARCHED_EVALS]);
    v_store(v_select(pool->passed, v_splat(-1.0f), v_select_or_zero(pool->found, v_splat(1.0f))),
            values[MARCHED_FOUND]);
    v_store(pool->ray, ray);
    for (unsigned rest = v_mask_bits(ended); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest), at = (int)ray[lane];
        for (int i = 0; i < MARCHED; i++)
            desk->marched[i][at] = values[i][lane];
    }
}

// How many lanes are still at work.
static inline int gaze_step(struct pool *pool, int k, vfloat cap, struct world *world) {
    struct group *group = &world->group;
    vmask live = group->live[k];
    ACTIVE(v_count(live));
    COUNT(gaze_step, call);
    vfloat t = group->t[k], distance = group->distance[k];
    vfloat hit_distance = v_splat((float)world->scene->model.march.hit_distance);
    vmask going = v_cmp_nlt_in(live, distance, least_step(t, hit_distance));
    vmask reached = v_andnot(going, live);
    group->t[k] = t = v_add_where(going, t, distance);
    pool->last = v_select(reached, distance, pool->last);
    pool->evals = v_add_where(live, pool->evals, v_splat(1.0f));
    vmask inside = v_cmp_ngt_in(going, beyond(pool->shade.exit, t), v_splat(0.0f));
    inside = v_cmp_lt_in(inside, pool->evals, cap);
    vmask on = v_cmp_ngt_in(inside, t, pool->length);
    pool->found = v_or(pool->found, reached);
    pool->passed = v_or(pool->passed, v_andnot(on, inside));
    group->live[k] = on;
    group->high[k] = v_select(on, group->high[k], v_splat(-INFINITY));
    return __builtin_popcount(v_mask_bits(on));
}

void march_gazes(struct world *world) {
    struct group *group = &world->group;
    struct stream stream;
    stream_begin(&stream, world->desk->gazes, false, world);
    vfloat cap = v_splat((float)step_cap(&world->scene->model));
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
