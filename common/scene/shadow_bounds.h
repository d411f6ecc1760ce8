// Bounds by which opt8_streams and opt9_convex know that a shadow ray is lit.
#pragma once

#include <math.h>

#include "scene/scene.h"

// Returns the radius of the bounding sphere about the shape's position. The factor 1 + 1e-5 covers rounding;
// a sphere's radius is exact.
static inline double bounding_radius(const struct shape *shape) {
    const double *half = shape->box.half_size;
    switch ((int)shape->type) {
    case SHAPE_SPHERE: return shape->sphere.radius;
    case SHAPE_BOX:
        return sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2]) * (1 + 1e-5);
    case SHAPE_ROUNDED_BOX:
        return (hypot(hypot(half[0], half[1]), half[2]) + shape->box.rounding) * (1 + 1e-5);
    case SHAPE_TORUS: return (shape->torus.major_radius + shape->torus.minor_radius) * (1 + 1e-5);
    case SHAPE_CONE:
        return hypot(fmax(shape->cone.bottom_radius, shape->cone.top_radius),
                     shape->cone.half_height) *
               (1 + 1e-5);
    case SHAPE_OCTAHEDRON: return shape->octahedron.radius * (1 + 1e-5);
    case SHAPE_MANDELBULB:
        return 1.15; // beyond 2^(1/7) every point escapes; see bulb/bulb_estimate.h of opt9
    case SHAPE_CAPSULE: return (shape->capsule.radius + shape->capsule.half_height) * (1 + 1e-5);
    case SHAPE_GROUP: return shape->group.nodes[shape->group.root].radius * (1 + 1e-5);
    default: return INFINITY;
    }
}

// Returns the least q such that a ray with h(t) ≥ q·t all along has no term of the estimator below 1, whatever its steps:
// by bisection of strength·min(q, q·√(1 − (1+q)²/4)/(1 − q·(1+q)/2)) = 1, whose terms rise with q (opt9's PROOFS.md, 1.).
static inline float lit_slope(double strength) {
    double low = 0, high = 1;
    for (int i = 0; i < 60; i++) {
        double q = (low + high) / 2, r = (1 + q) / 2;
        double away = q * sqrt(1 - r * r) / (1 - q * r);
        *(strength * fmin(q, away) >= 1 ? &high : &low) = q;
    }
    return (float)(high * (1 + 1e-5));
}
