// What render.c, rods.c, march.c and shade.c call of each other.
#ifndef RODS_TRACE_H
#define RODS_TRACE_H

#include <stdbool.h>

#include "frame/frame.h"
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
    int evals; // evaluations of the scene's distance; of a rod's pixel in the march that led to it
    double last, left; // where the march's last point is, and the distance to impact there
};

struct shaded {
    double color[3];
    double normal[3]; // 0 on a miss
    struct hit hit;
};

// Of a pixel: `evaluated` of the evaluations were for it (those of a rod are its first pixel's), and its own rod
// began at `start`; −1: it had none.
struct share {
    int evaluated;
    double start;
};

void get_direction(double column, double row, const struct frame *frame, const struct view *view,
                   double *direction);
void put_pixel(const struct world *world, struct frame *frame, int column, int row,
               const struct hit *hit, struct share share);

// Fills the frame's pixels by rods.
void march_rods(const struct world *world, struct frame *frame);

void ray_march(const double *origin, const double *direction, const struct prepared *scene,
               struct hit *hit);
double shadow(const double *point, const double *to_light, double distance,
              const struct prepared *scene);
// The light of result->hit, which is of a ray from outside of all mirrors or of one.
void shade(const double *direction, int bounce, const struct world *world, struct shaded *result);

#endif
