// What render.c and rods.c use of each other, beside opt2's march and shading.
#pragma once

#include "frame/frame.h"
#include "settings.h"
#include "trace.h"

// opt2's scene, and the settings behind it.
struct state {
    struct prepared prepared;
    struct settings settings;
    char settings_text[128];
};

static inline const struct state *state_of(const struct prepared *prepared) {
    return (const struct state *)prepared; // its first member
}

// Returns the distance to the nearest shape: opt2's sdf(), not inlined: gcc 12's copies are slower. In rods.c.
double scene_distance(const double *p, const struct prepared *scene, int *nearest);

// What a pixel's march cost, and where it ended. hit.evals: of a rod's pixel, those of the march that led to it.
struct pixel_cost {
    int evals;                    // those of a rod count for its first pixel
    double start;                 // where the pixel's own rod began; −1: it has none
    double last_t, last_distance; // the camera ray's last point, and the scene's distance there
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
