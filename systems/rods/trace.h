// What render.c, rods.c, and opt2's march.c and shade.c use of each other.
#pragma once

#include <stdbool.h>

#include "frame/frame.h"
#include "sdf.h"
#include "settings.h"

// opt2's scene, and the settings behind it.
struct state {
    struct prepared prepared;
    struct settings settings;
    char settings_text[128];
};

static inline const struct state *state_of(const struct prepared *prepared) {
    return (const struct state *)prepared; // its first member
}

// Returns the distance to the nearest shape: opt2's sdf(), compiled once for the files of this folder. In rods.c.
double scene_distance(const double *p, const struct prepared *scene, int *nearest);

// What a frame is drawn from.
struct world {
    const struct prepared *scene;
    const struct view *view;
};

struct hit {
    bool found;
    double t; // distance along the ray
    double point[3];
    int shape;
    int evals; // evaluations of the scene's distance; for a rod's pixel, in the march that led to it
    double last_t, last_distance; // a camera ray's last point, and the scene's distance there
};

struct shaded {
    double color[3];
    double normal[3]; // 0 on a miss
    struct hit hit;
};

// What a pixel's march cost. The evaluations of a rod count for its first pixel.
struct pixel_cost {
    int evals;
    double start; // where the pixel's own rod began; −1: it has none
};

// Computes the unit direction of the ray through a point of the picture.
// column, row: in pixels, from the middle of the top left one.
void get_direction(double column, double row, const struct frame *frame, const struct view *view,
                   double *direction);

// Shades and stores one pixel, whose camera ray the march followed to hit->t; hit->point is computed here.
// With picture=map it stores the march's last t, last distance and steps instead.
void put_pixel(const struct world *world, struct frame *frame, int column, int row,
               const struct hit *hit, struct pixel_cost cost);

// Fills the frame's pixels by rods.
void march_rods(const struct world *world, struct frame *frame);

// Sphere-traces a ray of unit direction until the distance is below the scene's hit distance.
void ray_march(const double *origin, const double *direction, const struct prepared *scene,
               struct hit *hit);

// Returns the share of the light that reaches the point, 0 to 1; between, the penumbra of a soft shadow.
// to_light is of unit length, and the light is `distance` away.
double shadow(const double *point, const double *to_light, double distance,
              const struct prepared *scene);

// Traces a ray and its reflections, and shades its hit; shade() shades a hit that is known. `bounce`: mirrors so far.
void trace(const double *origin, const double *direction, int bounce, const struct world *world,
           struct shaded *result);
void shade(const double *direction, int bounce, const struct world *world, struct shaded *result);
