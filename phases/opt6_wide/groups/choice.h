// Which program a packet of rays runs for a group: the group's whole one. In opt7_tiles, only what its rays need.
#pragma once

#include "core/packet_group.h"
#include "groups/program.h"

// Returns the program for the live rays of a packet at distance t, and for points within program->beside of them.
static inline const struct program *program_of_ray(const struct local_ray *a, vfloat t, vmask live,
                                                   const struct primitive *primitive) {
    (void)a;
    (void)t;
    (void)live;
    return primitive->program;
}

static inline const struct program *program_of_packets(const struct packet_group *group, int shape,
                                                       const struct primitive *primitive) {
    (void)group;
    (void)shape;
    return primitive->program;
}
