// How near to a point, and how far from it, a shape's path leads the shape's centre.
#pragma once

#include "scene/scene.h"

struct distance_range {
    double nearest, furthest;
};

// Returns the range of distances from `point` to the shape's centre, at any time, in scene units.
struct distance_range path_distance(const struct shape *shape, const double point[3]);
