// How near to a point, and how far from it, a shape's path leads the shape's centre.
#ifndef FIXED_PATH_DISTANCE_H
#define FIXED_PATH_DISTANCE_H

#include "scene/scene.h"

struct distance_range {
    double nearest, furthest;
};

// Returns the range of distances from `point` to the shape's centre, at any time, in scene units.
struct distance_range path_distance(const struct shape *shape, const double point[3]);

#endif
