// What tile.c, march.c and shade.c call of each other.
#ifndef OPT6_TRACE_H
#define OPT6_TRACE_H

#include "sdf.h"

struct world {
    const struct prepared *scene;
    const struct view *view;
    struct group group; // of the rays being marched now
    struct own *own;    // the worker's (tiles.h)
};

// Of the packets of the group that is under way. Only lanes of `active` are marched, shaded and written; the others may
// hold anything.
struct rays {
    struct place *origin;
    struct vec *direction;
    mask *active;
    real start; // where they begin
};

struct hit {
    mask found;
    real t; // distance along the ray
    struct place point;
    struct vec normal; // towards the ray; 0 where not found
    real shape;        // a whole number; −1 where not found
    real evals;        // evaluations of the scene's distance
};

struct shaded {
    struct vec color;
    struct hit hit;
};

// A ray leaves the bounds when |o + t·d|² > radius²: a polynomial in t, free of the point itself, and
// known to a few 2^-24 of radius²: within 2^-20 the ray goes on, and its hit is asked by within().
struct exit {
    real linear, constant; // t·(t + linear) + constant > 0
};

struct exit leaving(struct place origin, struct vec direction, const struct model *model);

void ray_march(const struct rays *rays, struct world *world, struct hit *hit);

struct lighting {
    struct vec to_light; // of unit length
    real distance, facing;
    mask lit;
};

// 1: the light reaches the point, 0: it does not; between, the
// penumbra of a soft shadow.
void shadow(const struct hit *hit, const struct lighting *light, struct world *world, real *reach);

// What a hit's place says, once it is the origin of its beam: more exactly than the march,
// which has rounded origin and direction in the frames of all shapes.
struct nearness {
    real distance, shape; // of the nearest
    mask contact;         // another shape is within two normal steps of it
};

struct nearness near_hit(mask found, const struct prepared *scene, struct beam *beam);
// Of hits that are the origins of the beam, and the slope there.
struct vec normal_at(struct vec direction, mask found, const struct nearness *near,
                     const struct prepared *scene, const struct beam *beam, real *slope);
void trace(const struct rays *rays, int bounce, struct world *world, struct shaded *result);

#endif
