// Camera rays that may meet a Mandelbulb: one stream (shadow/lane_refill.h) marches all rays of a strip before its
// patches are shaded.
#include "cones/distance_bounds.h"
#include "core/local_rays.h"
#include "core/ray_queues.h"
#include "core/sdf.h"
#include "core/trace_context.h"
#include "shadow/lane_refill.h"

// Returns the rays that come near the ball of a Mandelbulb. |v|² − (v·d)² has a rounding error of at most 2^-20 of
// |v|². `out` becomes the distance at which the last ball is behind the ray.
static vmask meets_bulbs(struct vec direction, vmask active, const struct trace_context *world,
                         vfloat *out) {
    vmask meets = v_mask_none();
    *out = v_splat(0.0f);
    for (int i = 0; i < world->scene->model.shape_count; i++) {
        const struct primitive *s = &world->scene->primitives[i];
        if (s->type != SHAPE_MANDELBULB)
            continue;
        if (s->repeated) {
            *out = v_splat(INFINITY);
            return active;
        }
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

void queue_camera_rays(struct vec direction, vmask active, int slot, struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    vfloat out, zero = v_splat(0.0f);
    vmask meets = meets_bulbs(direction, active, world, &out);
    v_store(zero, &queues->marched[MARCH_T][slot]);
    v_store(zero, &queues->marched[MARCH_LAST_STEP][slot]);
    v_store(zero, &queues->marched[MARCH_EVALS][slot]);
    v_store(v_select(meets, v_splat(0.0f), v_splat(-1.0f)), &queues->marched[MARCH_FOUND][slot]);
    if (!v_any(meets))
        return;
    queues->camera_slot[queues->camera_packets] = slot;
    queues->camera_active[queues->camera_packets++] = v_mask_bits(meets);
    v_store(direction.x, &queues->camera_direction[0][slot]);
    v_store(direction.y, &queues->camera_direction[1][slot]);
    v_store(direction.z, &queues->camera_direction[2][slot]);
}

static bool next_camera_packet(struct ray_stream *stream, int number, struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    int slot = queues->camera_slot[number];
    struct vec direction = {v_load(&queues->camera_direction[0][slot]),
                            v_load(&queues->camera_direction[1][slot]),
                            v_load(&queues->camera_direction[2][slot])};
    vmask waiting = v_mask_of_bits(queues->camera_active[number]);
    stream->packet = probe_rays(world->scratch, world->scene);
    set_local_origins(world->eye, world->scene, &stream->packet);
    set_local_directions(direction, world->scene, &stream->packet);
    stream->ready.shade.exit = bounds_exit_of(world->eye, direction, &world->scene->model);
    stream->ready.evals = stream->t = v_splat(0.0f);
    stream->ready.ray = v_iota() + v_splat((float)slot);
    meets_bulbs(direction, v_mask_all(), world, &stream->ready.length);
    prepare_packet(stream, waiting, world->scene);
    return true;
}

// Stores the results of ended lanes for resume_march().
static void finish_camera_rays(const struct refilled_packet *refilled, vmask ended, vfloat t,
                               struct ray_queues *queues) {
    float values[MARCH_FIELDS][LANES], ray[LANES];
    v_store(t, values[MARCH_T]);
    v_store(v_select_or_zero(refilled->found, refilled->last), values[MARCH_LAST_STEP]);
    v_store(refilled->evals, values[MARCH_EVALS]);
    v_store(v_select(refilled->passed, v_splat(-1.0f),
                     v_select_or_zero(refilled->found, v_splat(1.0f))),
            values[MARCH_FOUND]);
    v_store(refilled->ray, ray);
    for (unsigned rest = v_mask_bits(ended); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest), at = (int)ray[lane];
        for (int i = 0; i < MARCH_FIELDS; i++)
            queues->marched[i][at] = values[i][lane];
    }
}

// Takes a step. Returns how many lanes are still live.
static inline int camera_stream_step(struct refilled_packet *refilled, int k, vfloat cap,
                                     struct trace_context *world) {
    struct packet_group *group = world->group;
    vmask live = group->live[k];
    vfloat t = group->t[k], distance = group->distance[k];
    vfloat hit_distance = v_splat((float)world->scene->model.march.hit_distance);
    vmask going = v_cmp_nlt_in(live, distance, min_step(t, hit_distance));
    vmask reached = v_andnot(going, live);
    group->t[k] = t = v_add_where(going, t, distance);
    refilled->last = v_select(reached, distance, refilled->last);
    refilled->evals = v_add_where(live, refilled->evals, v_splat(1.0f));
    vmask inside = v_cmp_ngt_in(going, outside_of_bounds(refilled->shade.exit, t), v_splat(0.0f));
    inside = v_cmp_lt_in(inside, refilled->evals, cap);
    vmask on = v_cmp_ngt_in(inside, t, refilled->length);
    refilled->found = v_or(refilled->found, reached);
    refilled->passed = v_or(refilled->passed, v_andnot(on, inside));
    group->live[k] = on;
    group->high[k] = v_select(on, group->high[k], v_splat(-INFINITY));
    return __builtin_popcount(v_mask_bits(on));
}

void march_camera_stream(struct trace_context *world) {
    struct packet_group *group = world->group;
    struct ray_stream stream = {.count = world->queues->camera_packets,
                                .next_packet = next_camera_packet,
                                .finish_rays = finish_camera_rays};
    stream_begin(&stream, world);
    vfloat cap = v_splat((float)step_cap(&world->scene->model));
    for (int live; (live = refill_lanes(&stream, world)) > 0;) {
        struct sole_shape sole = {.shape = -1}; // refilled rays bring their own wakes
        for (int least = refill_threshold(&stream, live); live > least;) {
            scene_distances(group, world->scene, &sole);
            live = 0;
            for (int i = 0; i < group->count; i++) {
                int k = group->marching[i];
                live += camera_stream_step(&stream.refilled[k], k, cap, world);
            }
        }
    }
    world->queues->camera_packets = 0;
}
