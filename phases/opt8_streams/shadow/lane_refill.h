// Where Mandelbulbs are, some rays take a thousand steps and most a few dozen: lanes whose ray has ended are filled
// again from the rays that wait, so that the lanes of a packet are rays of different age. No lane's result depends on
// its neighbours, so that it is to the bit that of a packet which waits for its last ray.
#ifndef LANE_REFILL_H
#define LANE_REFILL_H

#include "core/packet_group.h"
#include "march/march_step.h"

struct trace_context; // core/trace_context.h
struct ray_queues;    // core/ray_queues.h

enum { REFILL = GROUP * LANES / 16 }; // lanes that have ended

// What the lanes of a packet have, but for what is in the group.
struct refilled_packet {
    struct shadow_state shade; // camera rays have its exit sole
    vfloat evals, length, end,
        ray;                   // ray: a whole number. REFILLED_FLOATS from the beginning to here
    vfloat last;               // of a camera ray that has been hit
    vmask held, found, passed; // with a ray, if it has ended or not; of those that have: how
};
enum { REFILLED_FLOATS = 8 };

// Packets of rays that are made ready one by one, and go lane by lane to where one is free.
struct ray_stream {
    int next, count; // of the packets that wait
    struct refilled_packet refilled[GROUP], ready;
    struct packet_rays packet; // of the one that is ready
    vfloat t, high;
    int waiting, gone; // of its rays
    // Makes packet `number` ready. Returns false if it has no ray.
    bool (*next_packet)(struct ray_stream *stream, int number, struct trace_context *world);
    // Stores the results of lanes whose ray has ended.
    void (*finish_rays)(const struct refilled_packet *refilled, vmask ended, vfloat t,
                        struct ray_queues *queues);
};

// The rays of m, which may start inside of a shape, move to the front; how far the steady shapes are is known of all of
// them at once: so no lane that is filled wakes one for the others.
void prepare_packet(struct ray_stream *stream, vmask m, const struct prepared *scene);
// What has ended is delivered, and lanes that are free get a ray, as long as there is one. How many lanes have one.
int refill_lanes(struct ray_stream *stream, struct trace_context *world);
// Nothing is under way.
void stream_begin(struct ray_stream *stream, struct trace_context *world);

// So many lanes may still be at work when the next rays are asked for.
static inline int refill_threshold(const struct ray_stream *stream, int live) {
    return stream->waiting || stream->next < stream->count ? live - REFILL : 0;
}

#endif
