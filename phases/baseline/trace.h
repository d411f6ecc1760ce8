// What render.c, march.c and shade.c call of each other.
#ifndef BASELINE_TRACE_H
#define BASELINE_TRACE_H

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

struct hit ray_march(struct vec3 origin, struct vec3 direction, struct world world);
double shadow(struct vec3 point, struct vec3 to_light, double distance, struct world world);
struct shaded trace(struct vec3 origin, struct vec3 direction, int bounce, struct world world);

#endif
