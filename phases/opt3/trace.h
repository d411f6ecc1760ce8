// What render.c, march.c and shade.c call of each other. A packet is four rays.
#pragma once

#include "sdf.h"

#include "packet/phong.h" // needs sdf.h

struct world {
    const struct prepared *scene;
    const struct view *view;
};

struct hit {
    vmask found;
    vdouble t; // distance along the ray
    struct vec point;
    vdouble shape; // an integer; −1 where not found
    vdouble evals; // evaluations of the scene's distance
};

#include "scene/instruction.h" // needs struct primitive

struct shaded {
    struct vec color;
    struct vec normal; // 0 on a miss
    struct hit hit;
};

// Marches a packet to its first hits. Only lanes of `active` are valid in `hit`.
void ray_march(struct vec origin, struct vec direction, vmask active, const struct prepared *scene,
               struct hit *hit);

// Returns the light that reaches each point, by the scene's kind of shadows: 0 in shadow, 1 lit, and
// between them in the penumbra of a soft shadow. `distance` is the light's. Only lanes of `active`
// are valid.
vdouble shadow(struct vec point, struct vec to_light, vdouble distance, vmask active,
               const struct prepared *scene);

// Traces a packet and its reflections, up to the scene's number of bounces, and shades its hits. Only
// lanes of `active` are valid in `result`.
void trace(struct vec origin, struct vec direction, vmask active, int bounce,
           const struct world *world, struct shaded *result);

// group.c: the materials at points of the world.
struct materials group_surface(struct vec point, const struct primitive *group,
                               const struct model *model);
