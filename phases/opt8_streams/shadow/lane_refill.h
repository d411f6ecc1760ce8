// Streams of rays. Near a Mandelbulb some rays take a thousand steps and most a few dozen. Lanes whose ray has ended
// are filled again from the rays that wait, so the lanes of a packet hold rays of different age. No lane's result
// depends on its neighbours: every bit is that of a packet which waits for its last ray.
#pragma once

#include "core/packet_group.h"
#include "march/march_step.h"

struct trace_context; // core/trace_context.h
struct ray_queues;    // core/ray_queues.h

enum { REFILL = GROUP * LANES / 16 }; // ended lanes before the next refill

// The state of a refilled packet's lanes, except the members of the group.
struct refilled_packet {
    struct shadow_state shade; // camera rays use its exit only
    vfloat evals, length, end,
        ray;                   // ray: a whole number. The first REFILLED_VECTORS vectors end here
    vfloat last;               // the last step of a camera ray that is hit
    vmask held, found, passed; // lanes with a ray, live or ended; how the ended rays have ended
};
enum { REFILLED_VECTORS = 8 };

// A stream: packets of rays are made ready one by one, and their rays fill lanes that are free.
struct ray_stream {
    int next, count; // packets that wait
    struct refilled_packet refilled[GROUP], ready;
    struct packet_rays packet; // the packet that is ready
    vfloat t, high;
    int waiting, gone; // rays of `ready`
    // Makes packet `number` ready. Returns false if it has no ray.
    bool (*next_packet)(struct ray_stream *stream, int number, struct trace_context *world);
    // Stores the results of lanes whose ray has ended.
    void (*finish_rays)(const struct refilled_packet *refilled, vmask ended, vfloat t,
                        struct ray_queues *queues);
};

// Moves the rays of m to the front of their packet. They may start inside a shape. The distances to all steady shapes
// are evaluated for the whole packet, so that a refilled lane wakes no shape for the others.
void prepare_packet(struct ray_stream *stream, vmask m, const struct prepared *scene);
// Stores the results of ended lanes, and gives free lanes a ray while there is one. Returns how many lanes have a ray.
int refill_lanes(struct ray_stream *stream, struct trace_context *world);
// Begins a stream: no lane has a ray.
void stream_begin(struct ray_stream *stream, struct trace_context *world);

// Returns how many lanes may be live when the next rays are loaded.
static inline int refill_threshold(const struct ray_stream *stream, int live) {
    return stream->waiting || stream->next < stream->count ? live - REFILL : 0;
}
