// What render.c, march.c and shade.c call of each other.
#pragma once

#include <stdbool.h>

#include "sdf.h"

struct world {
    const struct prepared *scene;
    const struct view *view;
};

struct hit {
    bool found;
    double t; // distance along the ray
    double point[3];
    int shape;
    int evals; // evaluations of the scene's distance
};

struct shaded {
    double color[3];
    double normal[3]; // 0 on a miss
    struct hit hit;
};

// Marches a ray to its first hit: the first point closer to the scene than its hit distance.
void ray_march(const double *origin, const double *direction, const struct prepared *scene,
               struct hit *hit);

// Returns the light that reaches the point, by the scene's kind of shadows: 0 in shadow, 1 lit, and
// between them in the penumbra of a soft shadow. `distance` is the light's; to_light is a unit vector.
double shadow(const double *point, const double *to_light, double distance,
              const struct prepared *scene);

// Traces a ray and its reflections, up to the scene's number of bounces, and shades its hit. The
// direction is a unit vector; `bounce` counts the mirrors so far.
void trace(const double *origin, const double *direction, int bounce, const struct world *world,
           struct shaded *result);

// Computes colour and normal of result->hit, where a ray of that direction has ended.
void shade(const double *direction, int bounce, const struct world *world, struct shaded *result);
