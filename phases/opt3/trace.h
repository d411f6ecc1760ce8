// What render.c, march.c and shade.c call of each other.
#ifndef OPT3_TRACE_H
#define OPT3_TRACE_H

#include "sdf.h"

struct world {
    const struct prepared *scene;
    const struct view *view;
};

struct hit {
    mask found;
    real t; // distance along the ray
    struct vec point;
    real shape; // a whole number; −1 where not found
    real evals; // evaluations of the scene's distance
};

struct shaded {
    struct vec color;
    struct vec normal; // 0 on a miss
    struct hit hit;
};

// Only lanes of `active` are marched, shaded and written; the others may hold anything.
void ray_march(struct vec origin, struct vec direction, mask active, const struct prepared *scene,
               struct hit *hit);
real shadow(struct vec point, struct vec to_light, real distance, mask active,
            const struct prepared *scene);
void trace(struct vec origin, struct vec direction, mask active, int bounce,
           const struct world *world, struct shaded *result);

#endif
