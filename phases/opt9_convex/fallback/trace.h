// Marching and shading of packets in frames that closed forms cannot draw: called by frame/tile.c.
#pragma once

#include "simd/simd.h"
#include "types/sdf.h"

// Packets that are marched in turns: while one waits for a result, the other computes.
enum { PAIR = 2 };

struct trace_context {
    const struct prepared *scene;
    const struct view *view;
    struct local_ray *local_rays; // one per shape: the rays being marched
};

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

// Only lanes of `active` are marched, shaded and written; the others may hold anything.
struct ray_pair {
    struct point origin[PAIR];
    struct vec direction[PAIR];
    vmask active[PAIR];
};

// world: one per packet.
void ray_march(const struct ray_pair *rays, const struct trace_context world[PAIR],
               struct hit hit[PAIR]);
// Sets light to 1 where it reaches a ray's origin, 0 where it does not, and values between in the penumbra of a soft
// shadow. The rays go towards the light, `distance` away.
void shadow(const struct ray_pair *rays, const vfloat distance[PAIR],
            const struct trace_context world[PAIR], vfloat light[PAIR]);
// What near_hit() finds at hits that are the origins of world->local_rays. More exact than the march, which
// rounds origin and direction in the frames of all shapes.
struct hit_surroundings {
    vfloat distance, shape; // of the nearest
    vmask contact;          // another shape is within two normal steps of it
};

struct hit_surroundings near_hit(vmask found, const struct trace_context *world);
// Returns the normals of hits that are the origins of world->local_rays, and the slope there.
struct vec normal_at(struct vec direction, vmask found, const struct hit_surroundings *near,
                     const struct trace_context *world, vfloat *slope);
void trace(const struct ray_pair *rays, int bounce, const struct trace_context world[PAIR],
           struct shaded result[PAIR]);
