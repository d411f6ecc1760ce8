// Streams of rays whose lanes are filled again: see shadow/lane_refill.h.
#include "shadow/lane_refill.h"
#include "core/shape_distances.h"
#include "core/trace_context.h"

static void pack_in_place(vmask m, vfloat *first, int count) {
    for (int i = 0; i < count; i++)
        v_compress_store(m, first[i], (float *)&first[i]);
}

// What of a shape's approach is used.
static int approach_reals(const struct primitive *placed) {
    return placed->way == EVAL_POWER ? 8 : 6;
}

void prepare_packet(struct ray_stream *stream, vmask m, const struct prepared *scene) {
    ACTIVE(v_count(m));
    COUNT(prepare_packet, call);
    struct packet_rays *beam = &stream->beam;
    vfloat least = v_splat(INFINITY);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *placed = &scene->placed[i];
        struct local_ray *a = &beam->approach[i];
        if (placed->steady) {
            COUNT(prepare_packet, steady);
            vfloat distance =
                distance_to_shape(a, stream->t, placed, false, placed->way, placed->type, m);
            beam->wake[i * GROUP] = wake_bound_inside(distance + stream->t, placed);
            least = v_min(distance, least);
            pack_in_place(m, &beam->wake[i * GROUP], 1);
        }
        pack_in_place(m, &a->origin.x, approach_reals(placed));
    }
    stream->high = least - stream->t + v_splat(1e-30f); // at distance 0 the shape is awake
    pack_in_place(m, &stream->ready.shade.least_sq, POOL_REALS);
    pack_in_place(m, &stream->t, 1);
    pack_in_place(m, &stream->high, 1);
    stream->waiting = __builtin_popcount(v_mask_bits(m));
    stream->gone = 0;
}

static void fill_reals(vmask m, vfloat *to, const vfloat *from, int gone, int count) {
    for (int i = 0; i < count; i++)
        to[i] = v_expand_load(m, to[i], (const float *)&from[i] + gone);
}

static void fill_lanes(struct ray_stream *stream, int k, unsigned lanes,
                       struct trace_context *world) {
    struct packet_group *group = world->group;
    struct refilled_packet *pool = &stream->pool[k];
    vmask m = v_mask_of_bits(lanes);
    int gone = stream->gone;
    fill_reals(m, &pool->shade.least_sq, &stream->ready.shade.least_sq, gone, POOL_REALS);
    fill_reals(m, &group->t[k], &stream->t, gone, 1);
    fill_reals(m, &group->high[k], &stream->high, gone, 1);
    for (int i = 0; i < world->scene->model.shape_count; i++) {
        const struct primitive *placed = &world->scene->placed[i];
        fill_reals(m, &group->beam[k].approach[i].origin.x, &stream->beam.approach[i].origin.x,
                   gone, approach_reals(placed));
        vfloat *wake = &group->beam[k].wake[i * GROUP];
        if (placed->steady)
            fill_reals(m, wake, &stream->beam.wake[i * GROUP], gone, 1);
        else
            *wake = v_select(m, v_splat(-INFINITY), *wake);
    }
    pool->found = v_andnot(m, pool->found);
    pool->passed = v_andnot(m, pool->passed);
    stream->gone += __builtin_popcount(lanes);
    stream->waiting -= __builtin_popcount(lanes);
}

// The first `count` of them.
static unsigned lowest_lanes(unsigned lanes, int count) {
    unsigned rest = lanes;
    for (; rest && count > 0; count--)
        rest &= rest - 1;
    return lanes & ~rest;
}

int refill_lanes(struct ray_stream *stream, struct trace_context *world) {
    struct packet_group *group = world->group;
    int live = 0;
    group->count = 0;
    for (int k = 0; k < GROUP; k++) {
        struct refilled_packet *pool = &stream->pool[k];
        unsigned lanes = v_mask_bits(group->live[k]),
                 free = v_mask_bits(v_andnot(group->live[k], v_mask_all()));
        vmask ended = v_andnot(group->live[k], pool->held);
        if (v_any(ended))
            stream->finish_rays(pool, ended, group->t[k], world->scratch);
        while (free) {
            while (stream->waiting == 0 && stream->next < stream->count) {
                int number = stream->next++;
                if (!stream->next_packet(stream, number, world))
                    stream->waiting = 0;
            }
            if (stream->waiting == 0)
                break;
            unsigned here = lowest_lanes(free, stream->waiting);
            fill_lanes(stream, k, here, world);
            lanes |= here;
            free &= ~here;
        }
        group->live[k] = pool->held = v_mask_of_bits(lanes);
        if (lanes)
            group->list[group->count++] = k;
        live += __builtin_popcount(lanes);
    }
    return live;
}

void stream_begin(struct ray_stream *stream, struct trace_context *world) {
    struct packet_group *group = world->group;
    for (int k = 0; k < GROUP; k++) {
        stream->pool[k].held = group->live[k] = v_mask_none();
        group->t[k] = v_splat(0.0f);
        group->high[k] = v_splat(-INFINITY);
        group->beam[k].list = world->scene->all;
    }
}
