// The surroundings of hits, their normals and their light.
#pragma once

#include "core/primitive.h"
#include "simd/simd.h"

struct packet_rays; // core/packet_group.h

struct lighting {
    struct vec to_light;     // of unit length
    vfloat distance, facing; // facing: normal·to_light
    vmask lit;
};

// The surroundings of a hit, evaluated with the hit as origin. The march is less exact: it has rounded origin and
// direction in the frames of all shapes.
struct hit_surroundings {
    vfloat distance, shape; // of the nearest
    vmask contact;          // another shape is within two normal steps of it
};

struct hit_surroundings near_hit(vmask found, const struct prepared *scene,
                                 struct packet_rays *packet);
// A hit's normal, on the side that the ray comes from, and the distance's slope along the ray: 1e30 where it is unknown.
struct hit_normal {
    struct vec normal;
    vfloat slope;
    vmask inward; // the ray comes from inside the shape
};

// Returns the normals of hits that are the origins of the packet.
struct hit_normal normal_at(struct vec direction, vmask found, const struct hit_surroundings *near,
                            const struct prepared *scene, const struct packet_rays *packet);
