// Packets of rays that march together.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

struct local_ray; // core/shape_distances.h

// A packet of rays. `high` + t is an upper bound of the distance to the nearest steady shape.
struct packet_rays {
    struct local_ray *local; // one per shape
    // One per shape, GROUP elements apart. A shape is not the nearest as long as its value exceeds t + the distance to
    // the nearest shape.
    vfloat *wake;
    vfloat high;
};

// Packets of a group march together, one instruction of each after the other, because a single packet would wait for
// its own operations. They share the choice of shapes: one that any of them needs is evaluated for all.
struct packet_group {
    struct packet_rays packet[GROUP];
    vfloat t[GROUP], distance[GROUP]; // of the last step
    vfloat high[GROUP]; // that of its packet; −∞ where a ray is done, which wakes no shape
    vmask live[GROUP];
    int marching[GROUP], count; // the packets that have a live ray
};

// Returns the shapes that the packet's rays may meet: all of the scene.
static inline const struct shape_list *shapes_of(const struct packet_rays *packet,
                                                 const struct prepared *scene) {
    (void)packet;
    return &scene->all;
}

static inline vfloat *wake_of(const struct packet_rays *packet, int shape) {
    return &packet->wake[shape * GROUP];
}

// Returns the number of packets in the group.
static inline int packets_in(const struct packet_group *group) {
    (void)group;
    return GROUP;
}
