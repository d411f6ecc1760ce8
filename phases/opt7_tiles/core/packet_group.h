// Packets of rays that march together.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

struct local_ray; // core/shape_distances.h

// A packet of rays. `high` + t is an upper bound of the distance to the nearest steady shape.
struct packet_rays {
    struct local_ray *local; // one per shape
    struct shape_list list;  // shapes that its rays can meet: the same for all packets of a group
    // One per shape, `apart` elements apart (GROUP, where that is every group's size). A shape is not the nearest as
    // long as its value exceeds t + the distance to the nearest shape.
    vfloat *wake;
    int apart;
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
    int size;                   // number of packets where that varies: SMALL_GROUP or GROUP
};

// Returns the shapes that the packet's rays may meet: its list (in opt6_wide: all of the scene).
static inline const struct shape_list *shapes_of(const struct packet_rays *packet,
                                                 const struct prepared *scene) {
    (void)scene;
    return &packet->list;
}

static inline vfloat *wake_of(const struct packet_rays *packet, int shape) {
    return &packet->wake[shape * (SMALL_GROUP < GROUP ? packet->apart : GROUP)];
}

// Returns the number of packets in the group.
static inline int packets_in(const struct packet_group *group) {
    return SMALL_GROUP < GROUP ? group->size : GROUP;
}

static inline void set_group_size(struct packet_group *group, int size) {
    group->size = size;
    for (int k = 0; k < size; k++)
        group->packet[k].apart = size;
}

// Returns a packet that marches alone.
static inline struct packet_rays single_packet(struct local_ray *local, struct shape_list list,
                                               vfloat *wake) {
    return (struct packet_rays){local, list, wake, 1, v_splat(0.0f)};
}
