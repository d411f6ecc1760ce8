// Where a shape's path leads it, from one point: the nearest and the furthest place of its centre, at any time.
#ifndef FIXED_PLACES_H
#define FIXED_PLACES_H

#include <math.h>

#include "scene/scene.h"

struct places {
    double nearest, furthest;
};

static inline double length_between(const double a[3], const double b[3]) {
    double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    return sqrt(x * x + y * y + z * z);
}

// A segment: its point nearest to the foot of the perpendicular, and one of its ends.
static inline struct places places_of_line(const double from[3], const double to[3],
                                           const double point[3]) {
    double along = 0, length_sq = 0, near[3];
    for (int i = 0; i < 3; i++) {
        along += (point[i] - from[i]) * (to[i] - from[i]);
        length_sq += (to[i] - from[i]) * (to[i] - from[i]);
    }
    double share = fmin(fmax(along / length_sq, 0), 1); // its ends differ (scene_path.c)
    for (int i = 0; i < 3; i++)
        near[i] = from[i] + share * (to[i] - from[i]);
    return (struct places){length_between(near, point),
                           fmax(length_between(from, point), length_between(to, point))};
}

// A circle: by how far the point is along its axis and from it.
static inline struct places places_of_circle(const struct path *path, const double on[3],
                                             const double point[3]) {
    double along = 0, off[3];
    const double zero[3] = {0}, radius = length_between(path->foot, on);
    for (int i = 0; i < 3; i++)
        along += (point[i] - path->foot[i]) * path->axis[i];
    for (int i = 0; i < 3; i++)
        off[i] = point[i] - path->foot[i] - along * path->axis[i];
    double from_axis = length_between(zero, off);
    return (struct places){hypot(along, from_axis - radius), hypot(along, from_axis + radius)};
}

static inline struct places places_of(const struct shape *shape, const double point[3]) {
    double still = length_between(shape->position, point);
    switch (shape->path.type) {
    case PATH_CIRCLE: return places_of_circle(&shape->path, shape->position, point);
    case PATH_LINE: return places_of_line(shape->position, shape->path.to, point);
    default: return (struct places){still, still};
    }
}

#endif
