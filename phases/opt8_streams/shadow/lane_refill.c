// Streams of rays whose lanes are filled again: see shadow/lane_refill.h.
#include "shadow/lane_refill.h"
#include "core/shape_distances.h"
#include "core/trace_context.h"
#include "groups/region.h"

#include <assert.h>
#include <stddef.h>

// A refilled packet and a local ray are moved as rows of vectors.
static_assert(offsetof(struct refilled_packet, last) == REFILLED_VECTORS * sizeof(vfloat),
              "the first vectors of a refilled packet");
static_assert(offsetof(struct local_ray, power) == 6 * sizeof(vfloat) &&
                  sizeof(struct local_ray) == 8 * sizeof(vfloat),
              "the vectors of a local ray");

// Packs the lanes of m to the front, in `count` vectors.
static void pack_in_place(vmask m, vfloat *first, int count) {
    for (int i = 0; i < count; i++)
        v_compress_store(m, first[i], (float *)&first[i]);
}

static int local_ray_vectors(const struct primitive *primitive) {
    return primitive->eval == EVAL_POWER ? 8 : 6;
}

void prepare_packet(struct ray_stream *stream, vmask m, const struct prepared *scene) {
    struct packet_rays *packet = &stream->packet;
    vfloat least = v_splat(INFINITY);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *primitive = &scene->primitives[i];
        struct local_ray *a = &packet->local[i];
        if (primitive->steady) {
            vfloat distance = distance_to_shape(a, stream->t, primitive, false, primitive->eval,
                                                primitive->type, m);
            packet->wake[i * GROUP] = wake_bound_inside(distance + stream->t, primitive);
            least = v_min(distance, least);
            pack_in_place(m, &packet->wake[i * GROUP], 1);
        }
        pack_in_place(m, (vfloat *)a, local_ray_vectors(primitive));
    }
    stream->high = least - stream->t + v_splat(1e-30f); // at distance 0 the shape is awake
    pack_in_place(m, (vfloat *)&stream->ready, REFILLED_VECTORS);
    pack_in_place(m, &stream->t, 1);
    pack_in_place(m, &stream->high, 1);
    stream->waiting = __builtin_popcount(v_mask_bits(m));
    stream->gone = 0;
}

// Fills the lanes of m in `count` vectors, from the packed lanes behind the first `gone`.
static void fill_vectors(vmask m, vfloat *to, const vfloat *from, int gone, int count) {
    for (int i = 0; i < count; i++)
        to[i] = v_expand_load(m, to[i], (const float *)&from[i] + gone);
}

static void fill_lanes(struct ray_stream *stream, int k, unsigned lanes,
                       struct trace_context *world) {
    struct packet_group *group = world->group;
    struct refilled_packet *refilled = &stream->refilled[k];
    vmask m = v_mask_of_bits(lanes);
    int gone = stream->gone;
    fill_vectors(m, (vfloat *)refilled, (const vfloat *)&stream->ready, gone, REFILLED_VECTORS);
    fill_vectors(m, &group->t[k], &stream->t, gone, 1);
    fill_vectors(m, &group->high[k], &stream->high, gone, 1);
    for (int i = 0; i < world->scene->model.shape_count; i++) {
        const struct primitive *primitive = &world->scene->primitives[i];
        fill_vectors(m, (vfloat *)&group->packet[k].local[i],
                     (const vfloat *)&stream->packet.local[i], gone, local_ray_vectors(primitive));
        if (primitive->eval == EVAL_FIELD)
            forget_region(group->packet[k].local[i].region);
        vfloat *wake = &group->packet[k].wake[i * GROUP];
        if (primitive->steady)
            fill_vectors(m, wake, &stream->packet.wake[i * GROUP], gone, 1);
        else
            *wake = v_select(m, v_splat(-INFINITY), *wake);
    }
    refilled->found = v_andnot(m, refilled->found);
    refilled->passed = v_andnot(m, refilled->passed);
    stream->gone += __builtin_popcount(lanes);
    stream->waiting -= __builtin_popcount(lanes);
}

// Returns the first `count` of the lanes.
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
        struct refilled_packet *refilled = &stream->refilled[k];
        unsigned lanes = v_mask_bits(group->live[k]),
                 free = v_mask_bits(v_andnot(group->live[k], v_mask_all()));
        vmask ended = v_andnot(group->live[k], refilled->held);
        if (v_any(ended))
            stream->finish_rays(refilled, ended, group->t[k], world->queues);
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
        group->live[k] = refilled->held = v_mask_of_bits(lanes);
        if (lanes)
            group->marching[group->count++] = k;
        live += __builtin_popcount(lanes);
    }
    return live;
}

void stream_begin(struct ray_stream *stream, struct trace_context *world) {
    struct packet_group *group = world->group;
    for (int k = 0; k < GROUP; k++) {
        stream->refilled[k].held = group->live[k] = v_mask_none();
        group->t[k] = v_splat(0.0f);
        group->high[k] = v_splat(-INFINITY);
        group->packet[k].list = world->scene->all;
    }
}
