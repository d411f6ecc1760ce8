// What the files of a packet's way call of each other: tile.c, march.c, shadow.c, normal.c and shade.c.
#ifndef TRACE_H
#define TRACE_H

#include "sdf.h"
#include "simd/point.h"

struct world {
    const struct prepared *scene;
    const struct view *view;
    struct group group; // of the rays being marched now
};

// Only lanes of `active` are marched, shaded and written; the others may hold anything.
struct rays {
    struct point origin[GROUP];
    struct vec direction[GROUP];
    vmask active[GROUP];
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

void ray_march(const struct rays *rays, struct world *world, struct hit hit[GROUP]);

struct lighting {
    struct vec to_light; // of unit length
    vfloat distance, facing;
    vmask lit;
};

// From points that are the origins of world->group. 1: the light reaches the point, 0: it does not; between, the
// penumbra of a soft shadow.
void shadow(const struct hit hit[GROUP], const struct lighting light[GROUP], struct world *world,
            vfloat reach[GROUP]);

// What a hit's place says, once it is the origin of its beam: more exactly than the march,
// which has rounded origin and direction in the frames of all shapes.
struct nearness {
    vfloat distance, shape; // of the nearest
    vmask contact;          // another shape is within two normal steps of it
};

struct nearness near_hit(vmask found, const struct prepared *scene, struct beam *beam);
// Of hits that are the origins of the beam, and the slope there.
struct vec normal_at(struct vec direction, vmask found, const struct nearness *near,
                     const struct prepared *scene, const struct approach *approach, vfloat *slope);
void trace(const struct rays *rays, int bounce, struct world *world, struct shaded result[GROUP]);

#endif
