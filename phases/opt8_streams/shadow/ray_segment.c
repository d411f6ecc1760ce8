// Shadow rays in a scene with a Mandelbulb. Its estimate costs more than all other shapes, and for most of a ray's
// path a plane is nearer than any Mandelbulb can be. So a ray has a *segment* where a Mandelbulb may be the nearest.
// Before the segment it marches in packets among the other shapes, through it in a stream (shadow/lane_refill.h), and
// behind it in packets again. Its steps stay the same: a shape left out is further than the distance returned.
#include "bulb/bulb_estimate.h"
#include "cones/distance_bounds.h"
#include "core/local_rays.h"
#include "core/ray_queues.h"
#include "core/sdf.h"
#include "core/trace_context.h"
#include "shading/shadow_step.h"
#include "shadow/lane_refill.h"

struct ray_segment {
    vfloat from, to; // from > to: none
};

// Returns where |origin + t·direction| < radius + t·slope, never narrower. `along` is origin·direction, `square` is
// |origin|². With a slope near 1 the segment is everything.
static struct ray_segment segment_within(vfloat along, vfloat square, vfloat radius, vfloat slope) {
    vfloat none = v_splat(INFINITY), zero = v_splat(0.0f);
    vfloat a = v_nmadd(slope, slope, v_splat(1.0f));
    vfloat b = v_msub(radius, slope, along);
    vfloat c = v_nmadd(radius, radius, square);
    vfloat discriminant = v_nmadd(a, c, b * b);
    discriminant = v_madd(v_splat(0x1p-20f), v_madd(b, b, v_abs(c)),
                          discriminant); // rounding errors
    vfloat side = v_sqrt(v_max(discriminant, zero)), per = v_splat(1.0f) / a;
    vfloat from = (b - side) * per, to = (b + side) * per;
    vmask some = v_and(v_cmp_ge(discriminant, zero), v_cmp_ge(to, zero));
    vmask narrow = v_cmp_gt(a, v_splat(0x1p-6f));
    from = v_select(some, from, none);
    to = v_select(some, to, -none);
    return (struct ray_segment){v_select(narrow, from, -none), v_select(narrow, to, none)};
}

// Returns where the Mandelbulb may be nearer than the plane. Its estimate is at least half of the distance to its
// ball, and above the tangent of its form from afar.
static struct ray_segment segment_before_plane(const struct local_ray *bulb,
                                               const struct local_ray *plane,
                                               const struct primitive *primitive) {
    vfloat height = plane->origin.x, slope = plane->direction.x + v_splat(0x1p-12f);
    height = v_madd(v_splat(0x1p-10f), v_abs(height), height + v_splat(0x1p-10f));
    vfloat along = vec_dot(bulb->origin, bulb->direction);
    vfloat square = vec_dot(bulb->origin, bulb->origin);
    vfloat near_radius = v_madd(v_splat(2.0f), height, v_splat(primitive->a));
    struct ray_segment near = segment_within(along, square, near_radius, slope + slope);
    struct ray_segment far = segment_within(along, square, height + v_splat(FAR_TANGENT), slope);
    return (struct ray_segment){v_max(near.from, far.from), v_min(near.to, far.to)};
}

static struct ray_segment segment_of(const struct packet_rays *packet,
                                     const struct prepared *scene) {
    struct ray_segment all = {v_splat(INFINITY), v_splat(-INFINITY)};
    for (int i = 0; i < scene->model.shape_count; i++) {
        if (scene->primitives[i].trust != BOUND_BALL)
            continue;
        struct ray_segment one = {v_splat(-INFINITY), v_splat(INFINITY)};
        for (int j = 0; j < scene->model.shape_count && !scene->primitives[i].repeated; j++) {
            if (scene->primitives[j].eval != EVAL_LINEAR)
                continue;
            struct ray_segment here =
                segment_before_plane(&packet->local[i], &packet->local[j], &scene->primitives[i]);
            one.from = v_max(one.from, here.from);
            one.to = v_min(one.to, here.to);
        }
        vmask some = v_cmp_ge(one.to, one.from);
        all.from = v_select(some, v_min(all.from, one.from), all.from);
        all.to = v_select(some, v_max(all.to, one.to), all.to);
    }
    return all;
}

// Loads the queued shadow rays from `first` on. Returns the lanes that have one.
static vmask load_shadow_rays(int first, struct ray_queues *queues, struct point *origin,
                              struct vec *to_light) {
    float (*field)[QUEUE_ROOM] = queues->shadow;
    *origin = (struct point){load_vec(field + S_HI, first), load_vec(field + S_LO, first)};
    *to_light = load_vec(field + S_TO_LIGHT, first);
    return lanes_until(queues->shadows - first);
}

// Four packets that march together among the other shapes.
struct segment_packets {
    struct shadow_state shade[GROUP];
    vfloat evals[GROUP], length[GROUP], until[GROUP];
    vmask there[GROUP]; // rays that have come to the segment
};

static void begin_segment(struct segment_packets *packets, int k, int first, bool before,
                          struct shape_list others, struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    struct packet_group *group = world->group;
    struct packet_rays *packet = &group->packet[k];
    struct point origin;
    struct vec to_light;
    vmask active = load_shadow_rays(first, queues, &origin, &to_light);
    if (!before)
        active = v_mask_of_bits(queues->under_way[first / LANES]);
    packets->there[k] = group->live[k] = v_mask_none();
    packet->list = before ? world->scene->all : others;
    if (v_any(active)) {
        set_local_origins(origin, world->scene, packet);
        set_local_directions(to_light, world->scene, packet);
        packets->shade[k].exit = bounds_exit_of(origin, to_light, &world->scene->model);
        packets->length[k] = v_load(&queues->shadow[S_DISTANCE][first]);
        packets->until[k] = v_splat(INFINITY);
        if (before) {
            struct ray_segment segment = segment_of(packet, world->scene);
            packets->until[k] = segment.from;
            v_store(segment.to, &queues->segment[SEGMENT_END][first]);
        }
        group->t[k] = v_load(&queues->segment[SEGMENT_T][first]);
        packets->shade[k].least_sq = v_load(&queues->segment[SEGMENT_LEAST_SQ][first]);
        packets->shade[k].twice_previous = v_load(&queues->segment[SEGMENT_TWICE][first]);
        packets->evals[k] = v_load(&queues->segment[SEGMENT_EVALS][first]);
        group->live[k] = v_cmp_lt_in(active, group->t[k], packets->until[k]);
        packets->there[k] = v_andnot(group->live[k], active);
    }
    packet->list = others;
}

// Takes a packet's step. Returns false after the last.
static inline bool step_among_others(struct segment_packets *packets, int k, float strength_sq,
                                     vfloat cap, struct trace_context *world) {
    struct packet_group *group = world->group;
    const struct model *model = &world->scene->model;
    vmask live = group->live[k];
    packets->evals[k] = v_add_where(live, packets->evals[k], v_splat(1.0f));
    vmask on = model->shadows == SHADOWS_SOFT
                   ? soft_step(&packets->shade[k], k, strength_sq, group, model)
                   : hard_step(&packets->shade[k], packets->length[k], k, group, model);
    on = v_cmp_lt_in(on, packets->evals[k], cap);
    vmask before = v_cmp_lt_in(on, group->t[k], packets->until[k]);
    if (v_same(before, live))
        return true;
    packets->there[k] = v_or(packets->there[k], v_andnot(before, on));
    return end_shadow_rays(k, before, group);
}

// Sets the group's distances where a plane is the only other shape.
static inline void plane_distances(struct packet_group *group, const struct primitive *plane) {
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        const struct local_ray *a = &group->packet[k].local[(int)plane->index];
        group->distance[k] = v_madd(a->direction.x, group->t[k], a->origin.x);
    }
}

// Marches four packets of the queue up to their segments, or (`before` false) from behind them on.
static void march_among_others(int first, bool before, struct shape_list others,
                               struct trace_context *world) {
    struct packet_group *group = world->group;
    struct ray_queues *queues = world->queues;
    const struct model *model = &world->scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    vfloat cap = v_splat((float)step_cap(model));
    struct segment_packets packets;
    for (int k = 0; k < GROUP; k++)
        begin_segment(&packets, k, first + k * LANES, before, others, world);
    start_packets(group);
    unsigned begun = 0;
    for (int i = 0; i < group->count; i++)
        begun |= 1u << group->marching[i];
    const struct primitive *plane = single_shape(SHAPE_PLANE, world->scene);
    struct sole_shape sole = {.shape = -1};
    while (group->count > 0) {
        if (world->scene->single_bulb && plane)
            plane_distances(group, plane);
        else
            scene_distances(group, world->scene, &sole);
        for (int i = 0; i < group->count;)
            if (step_among_others(&packets, group->marching[i], strength_sq, cap, world))
                i++;
            else
                group->marching[i] = group->marching[--group->count];
    }
    for (int k = 0; k < GROUP; k++) {
        int at = first + k * LANES;
        queues->under_way[at / LANES] = v_mask_bits(packets.there[k]);
        if (!(begun >> k & 1))
            continue;
        v_store(group->t[k], &queues->segment[SEGMENT_T][at]);
        v_store(packets.shade[k].least_sq, &queues->segment[SEGMENT_LEAST_SQ][at]);
        v_store(packets.shade[k].twice_previous, &queues->segment[SEGMENT_TWICE][at]);
        v_store(packets.evals[k], &queues->segment[SEGMENT_EVALS][at]);
    }
}

// Makes one packet of rays that have come to their segment ready for the stream.
static bool next_shadow_packet(struct ray_stream *stream, int number, struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    int first = number * LANES;
    struct point origin;
    struct vec to_light;
    load_shadow_rays(first, queues, &origin, &to_light);
    vmask waiting = v_mask_of_bits(queues->under_way[number]);
    queues->under_way[number] = 0;
    if (!v_any(waiting))
        return false;
    stream->packet = probe_rays(world->scratch, world->scene);
    set_local_origins(origin, world->scene, &stream->packet);
    set_local_directions(to_light, world->scene, &stream->packet);
    stream->ready.shade =
        (struct shadow_state){v_load(&queues->segment[SEGMENT_LEAST_SQ][first]),
                              v_load(&queues->segment[SEGMENT_TWICE][first]),
                              bounds_exit_of(origin, to_light, &world->scene->model)};
    stream->ready.evals = v_load(&queues->segment[SEGMENT_EVALS][first]);
    stream->ready.length = v_load(&queues->shadow[S_DISTANCE][first]);
    stream->ready.end = v_load(&queues->segment[SEGMENT_END][first]);
    stream->ready.ray = v_iota() + v_splat((float)first);
    stream->t = v_load(&queues->segment[SEGMENT_T][first]);
    prepare_packet(stream, waiting, world->scene);
    return true;
}

static void finish_shadow_rays(const struct refilled_packet *refilled, vmask ended, vfloat t,
                               struct ray_queues *queues) {
    float values[SEGMENT_END][LANES], ray[LANES];
    v_store(t, values[SEGMENT_T]);
    v_store(refilled->shade.least_sq, values[SEGMENT_LEAST_SQ]);
    v_store(refilled->shade.twice_previous, values[SEGMENT_TWICE]);
    v_store(refilled->evals, values[SEGMENT_EVALS]);
    v_store(refilled->ray, ray);
    for (unsigned rest = v_mask_bits(ended), passed = v_mask_bits(refilled->passed); rest;
         rest &= rest - 1) {
        int lane = __builtin_ctz(rest), at = (int)ray[lane];
        for (int i = 0; i < SEGMENT_END; i++)
            queues->segment[i][at] = values[i][lane];
        queues->under_way[at / LANES] |= (passed >> lane & 1) << at % LANES;
    }
}

// Takes a step. Returns how many lanes are still live.
static inline int shadow_stream_step(struct refilled_packet *refilled, int k, float strength_sq,
                                     vfloat cap, struct trace_context *world) {
    struct packet_group *group = world->group;
    const struct model *model = &world->scene->model;
    ACTIVE(v_count(group->live[k]));
    COUNT(shadow_stream_step, call);
    refilled->evals = v_add_where(group->live[k], refilled->evals, v_splat(1.0f));
    vmask on = model->shadows == SHADOWS_SOFT
                   ? soft_step(&refilled->shade, k, strength_sq, group, model)
                   : hard_step(&refilled->shade, refilled->length, k, group, model);
    on = v_cmp_lt_in(on, refilled->evals, cap);
    vmask stay = v_cmp_ngt_in(on, group->t[k], refilled->end);
    refilled->passed = v_or(refilled->passed, v_andnot(stay, on));
    group->live[k] = stay;
    group->high[k] = v_select(stay, group->high[k], v_splat(-INFINITY));
    return __builtin_popcount(v_mask_bits(stay));
}

// Sets the group's distances where a Mandelbulb and at most a plane are all shapes.
static inline void single_bulb_distances(struct packet_group *group, const struct primitive *bulb,
                                         const struct primitive *plane) {
    struct scaled_orbit b[GROUP];
    struct vec p[GROUP];
    int i = (int)bulb->index;
    for (int k = 0; k < GROUP; k++) {
        const struct local_ray *a = &group->packet[k].local[i];
        p[k] = vec_along(a->origin, a->direction, group->t[k]);
        bulb_begin(&b[k], p[k], group->live[k]);
    }
    bulbs_end(bulb, 0, false, false, false, GROUP, b, p, group->distance);
    for (int k = 0; plane && k < GROUP; k++) {
        const struct local_ray *a = &group->packet[k].local[(int)plane->index];
        vfloat height = v_madd(a->direction.x, group->t[k], a->origin.x);
        group->distance[k] = v_min(group->distance[k], height);
    }
}

static void march_segments(struct trace_context *world) {
    struct packet_group *group = world->group;
    const struct model *model = &world->scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct ray_stream stream = {.count = (world->queues->shadows + LANES - 1) / LANES,
                                .next_packet = next_shadow_packet,
                                .finish_rays = finish_shadow_rays};
    stream_begin(&stream, world);
    vfloat cap = v_splat((float)step_cap(model));
    const struct primitive *bulb = single_shape(SHAPE_MANDELBULB, world->scene);
    const struct primitive *plane = single_shape(SHAPE_PLANE, world->scene);
    for (int live; (live = refill_lanes(&stream, world)) > 0;) {
        struct sole_shape sole = {.shape = -1}; // refilled rays bring their own wakes
        for (int least = refill_threshold(&stream, live); live > least;) {
            if (world->scene->single_bulb)
                single_bulb_distances(group, bulb, plane);
            else
                scene_distances(group, world->scene, &sole);
            live = 0;
            for (int i = 0; i < group->count; i++) {
                int k = group->marching[i];
                live += shadow_stream_step(&stream.refilled[k], k, strength_sq, cap, world);
            }
        }
    }
}

// Sets the state in which every ray begins.
static void begin_segments(struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    vfloat start = v_splat((float)world->scene->model.march.surface_offset);
    for (int first = 0; first < queues->shadows; first += LANES) {
        v_store(start, &queues->segment[SEGMENT_T][first]);
        v_store(v_splat(1.0f), &queues->segment[SEGMENT_LEAST_SQ][first]);
        // its square times t² and strength² is still a float
        v_store(v_splat(1e14f), &queues->segment[SEGMENT_TWICE][first]);
        v_store(v_splat(0.0f), &queues->segment[SEGMENT_EVALS][first]);
    }
}

// Returns all shapes without the Mandelbulbs.
static struct shape_list list_other_shapes(const struct prepared *scene,
                                           struct march_scratch *scratch) {
    for (int i = 0; i < scene->model.shape_count; i++)
        scratch->wanted[i] = scene->primitives[i].trust != BOUND_BALL;
    return list_wanted(scratch->wanted, scene, scratch->shadow);
}

void cast_streams(struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    struct shape_list others = list_other_shapes(world->scene, world->scratch);
    begin_segments(world);
    for (int first = 0; first < queues->shadows; first += GROUP_RAYS)
        march_among_others(first, true, others, world);
    march_segments(world);
    for (int first = 0; first < queues->shadows; first += GROUP_RAYS)
        march_among_others(first, false, others, world);
    for (int first = 0; first < queues->shadows; first += LANES) {
        vmask there = lanes_until(queues->shadows - first);
        vfloat reach = v_sqrt(v_load(&queues->segment[SEGMENT_LEAST_SQ][first]));
        struct vec light = vec_scale(load_vec(queues->shadow + S_LIGHT, first), reach);
        add_light(there, light, v_load(&queues->shadow[S_PIXEL][first]), queues);
    }
}
