// Signed distances in double-double: for the soft shadow's estimator, fractals and phase_distances.
#pragma once

#include "number/dd.h"
#include "spans/ray_spans.h"

// Moves, rotates and wraps a point into the shape's own frame.
void to_frame(const struct solid *solid, const struct dd p[3], struct dd local[3]);

// Returns the signed distance of a shape that is no group at a point of its own frame.
struct dd shape_distance(const struct shape *shape, const struct dd local[3]);

// groups/sdf_group.c: returns the shape's signed distance at a point of the scene; a fractal's is an estimate.
struct dd distance_to(const struct solid *solid, const struct dd p[3]);
