// From a ray to its colour: the data of each stage, and the functions that the stages call. core/tile.c calls trace(),
// which calls ray_march() and queues shadow and mirror rays; ray_march() calls near_hit() and normal_at().
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
    vmask smooth;      // the normal is a closed form, and points out of the shape
    vfloat shape;      // a whole number; −1 where not found
    vfloat evals;      // evaluations of the scene's distance
};

void ray_march(const struct ray_group *rays, struct trace_context *world, struct hit *hit);

// Sets the colours of the rays, times their weight. Shadow and mirror rays are queued and add their part later.
void trace(const struct ray_group *rays, struct trace_context *world, struct vec *color,
           struct hit *hit);
