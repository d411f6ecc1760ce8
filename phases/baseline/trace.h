// What render.c, march.c and shade.c call of each other.
#pragma once

#include <stdbool.h>

#include "sdf.h"

struct hit {
    bool found;
    double t; // distance along the ray
    struct vec3 point;
    int shape;
    int evals; // evaluations of the scene's distance
};

struct shaded {
    struct vec3 color;
    struct vec3 normal; // 0 on a miss
    struct hit hit;
};

// Marches a ray to its first hit: the first point closer to the scene than its hit distance.
struct hit ray_march(struct vec3 origin, struct vec3 direction, struct world world);

// Returns the light that reaches the point, by the scene's kind of shadows: 0 in shadow, 1 lit, and
// between them in the penumbra of a soft shadow. `distance` is the light's; to_light is a unit vector.
double shadow(struct vec3 point, struct vec3 to_light, double distance, struct world world);

// Traces a ray and its reflections, up to the scene's number of bounces, and shades its hit. The
// direction is a unit vector; `bounce` counts the mirrors so far.
struct shaded trace(struct vec3 origin, struct vec3 direction, int bounce, struct world world);
