// What the files of a packet's way call of each other: core/tile.c, march/march.c, shading/shadow.c, shading/normal.c and shading/shade.c.
#ifndef TRACE_H
#define TRACE_H

#include "core/sdf.h"
#include "march/march_step.h"
#include "simd/point.h"

struct trace_context {
    const struct prepared *scene;
    const struct view *view;
    struct packet_group group; // of the rays being marched now
    struct march_scratch *own; // the worker's (cones/tile_cones.h)
};

// Of the packets of the group that is under way. Only lanes of `active` are marched, shaded and written; the others may
// hold anything.
struct ray_group {
    struct point *origin;
    struct vec *direction;
    vmask *active;
    vfloat start; // where they begin
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

void ray_march(const struct ray_group *rays, struct trace_context *world, struct hit *hit);

struct lighting {
    struct vec to_light; // of unit length
    vfloat distance, facing;
    vmask lit;
};

// 1: the light reaches the point, 0: it does not; between, the
// penumbra of a soft shadow.
void shadow(const struct hit *hit, const struct lighting *light, struct trace_context *world,
            vfloat *reach);

// What a hit's place says, once it is the origin of its beam: more exactly than the march,
// which has rounded origin and direction in the frames of all shapes.
struct hit_surroundings {
    vfloat distance, shape; // of the nearest
    vmask contact;          // another shape is within two normal steps of it
};

struct hit_surroundings near_hit(vmask found, const struct prepared *scene,
                                 struct packet_rays *beam);
// Of hits that are the origins of the beam, and the slope there.
struct vec normal_at(struct vec direction, vmask found, const struct hit_surroundings *near,
                     const struct prepared *scene, const struct packet_rays *beam, vfloat *slope);
void trace(const struct ray_group *rays, int bounce, struct trace_context *world,
           struct shaded *result);

#endif
