// What render.c, march.c and shade.c call of each other.
#ifndef OPT10_TRACE_H
#define OPT10_TRACE_H

#include "sdf.h"

struct world {
    const struct prepared *scene;
    const struct view *view;
    struct approach *approach; // one per shape: of the rays being marched now
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

// Only lanes of `active` are marched, shaded and written; the others may hold anything.
void ray_march(struct place origin, struct vec direction, mask active, const struct world *world,
               struct hit *hit);
real shadow(struct place point, struct vec to_light, real distance, mask active,
            const struct world *world);
// What a hit's place says, once it is the origin of world->approach: more exactly than the march,
// which has rounded origin and direction in the frames of all shapes.
struct nearness {
    real distance, shape; // of the nearest
    mask contact;         // another shape is within two normal steps of it
};

struct nearness near_hit(mask found, const struct world *world);
// Of hits that are the origins of world->approach, and the slope there.
struct vec normal_at(struct vec direction, mask found, const struct nearness *near,
                     const struct world *world, real *slope);
void trace(struct place origin, struct vec direction, mask active, int bounce,
           const struct world *world, struct shaded *result);

#endif
