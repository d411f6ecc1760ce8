// Distances from a point to the places of a shape on its path: a fixed place, a segment or a circle.
#include "path_distance.h"

#include <math.h>

static double length_between(const double a[3], const double b[3]) {
    double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    return sqrt(x * x + y * y + z * z);
}

// A segment: nearest at the foot of the perpendicular if that is inside, furthest at one of the ends.
static struct distance_range line_distance(const double from[3], const double to[3],
                                           const double point[3]) {
    double along = 0, length_sq = 0, near[3];
    for (int i = 0; i < 3; i++) {
        along += (point[i] - from[i]) * (to[i] - from[i]);
        length_sq += (to[i] - from[i]) * (to[i] - from[i]);
    }
    double share = fmin(fmax(along / length_sq, 0), 1); // scene/path.c refuses a path of length 0
    for (int i = 0; i < 3; i++)
        near[i] = from[i] + share * (to[i] - from[i]);
    return (struct distance_range){length_between(near, point),
                                   fmax(length_between(from, point), length_between(to, point))};
}

// A circle: from the point's height above the circle's plane and its distance to the axis.
static struct distance_range circle_distance(const struct path *path, const double on[3],
                                             const double point[3]) {
    double height = 0, off[3];
    const double zero[3] = {0}, radius = length_between(path->foot, on);
    for (int i = 0; i < 3; i++)
        height += (point[i] - path->foot[i]) * path->axis[i];
    for (int i = 0; i < 3; i++)
        off[i] = point[i] - path->foot[i] - height * path->axis[i];
    double to_axis = length_between(zero, off);
    return (struct distance_range){hypot(height, to_axis - radius),
                                   hypot(height, to_axis + radius)};
}

struct distance_range path_distance(const struct shape *shape, const double point[3]) {
    double still = length_between(shape->position, point);
    switch (shape->path.type) {
    case PATH_CIRCLE: return circle_distance(&shape->path, shape->position, point);
    case PATH_LINE: return line_distance(shape->position, shape->path.to, point);
    default: return (struct distance_range){still, still};
    }
}
