// From a ray to its colour: the data of each stage, and the functions that the stages call. core/tile.c calls trace(),
// which calls ray_march() and then shadow(); ray_march() calls near_hit() and normal_at().
#pragma once

#include "core/primitive.h"
#include "simd/simd.h"

struct packet_rays; // core/packet_group.h
struct ray_group;
struct trace_context; // core/trace_context.h

struct hit {
    vmask found;
    vfloat t; // distance along the ray
    struct point point;
    struct vec normal; // towards the ray; 0 where not found
    vfloat shape;      // a whole number; −1 where not found
    vfloat evals;      // evaluations of the scene's distance
};

struct shaded {
    struct vec color;
    struct hit hit;
};

void ray_march(const struct ray_group *rays, struct trace_context *world, struct hit *hit);

struct lighting {
    struct vec to_light;     // of unit length
    vfloat distance, facing; // facing: normal·to_light
    vmask lit;
};

// Sets how much of the light reaches each hit: 1 lit, 0 in shadow, between them the penumbra of a soft shadow. The
// hits must be the origins of the group's packets.
void shadow(const struct hit *hit, const struct lighting *light, struct trace_context *world,
            vfloat *reach);

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

void trace(const struct ray_group *rays, int bounce, struct trace_context *world,
           struct shaded *result);
