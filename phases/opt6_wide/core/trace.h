// From a ray to its colour: the data of each stage, and the functions that the stages call. core/tile.c calls trace(),
// which calls ray_march() and then shadow(); ray_march() calls near_hit() and normal_at().
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

#include "core/near_hit.h" // needs simd.h

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

// Sets how much of the light reaches each hit: 1 lit, 0 in shadow, between them the penumbra of a soft shadow. The
// hits must be the origins of the group's packets.
void shadow(const struct hit *hit, const struct lighting *light, struct trace_context *world,
            vfloat *reach);

void trace(const struct ray_group *rays, int bounce, struct trace_context *world,
           struct shaded *result);
