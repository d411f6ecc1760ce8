// Bundles of shadow rays that opt8_streams and opt9_convex test against bounding spheres.
#pragma once

#include <math.h>
#include <stdbool.h>

// A bundle of shadow rays: they start in a ball, and their directions differ from to_light by at most `spread`.
struct light_bundle {
    float centre[3], radius, to_light[3], spread;
};

// Sets the bundle of rays from a box to the light. Returns false if the box is too large for the distance to the light,
// or infinite or NaN.
static inline bool light_bundle_of(const float low[3], const float high[3], const float light[3],
                                   struct light_bundle *bundle) {
    float square = 0, distance = 0;
    for (int k = 0; k < 3; k++) {
        bundle->centre[k] = 0.5f * (low[k] + high[k]);
        square += 0.25f * (high[k] - low[k]) * (high[k] - low[k]);
        bundle->to_light[k] = light[k] - bundle->centre[k];
        distance += bundle->to_light[k] * bundle->to_light[k];
    }
    distance = sqrtf(distance);
    bundle->radius = sqrtf(square) * (1 + 1e-4f);
    bundle->spread = bundle->radius / (distance - bundle->radius);
    for (int k = 0; k < 3; k++)
        bundle->to_light[k] /= distance;
    return bundle->radius < 0.25f * distance;
}

// Returns whether no cone of slope q about a ray of the bundle meets a shape's bounding sphere.
static inline bool bundle_misses(const struct light_bundle *bundle, const float position[3],
                                 float bound, float q) {
    float radius = bound + bundle->radius, along = 0, c = -radius * radius;
    q += bundle->spread;
    for (int k = 0; k < 3; k++) {
        float v = position[k] - bundle->centre[k];
        along += v * bundle->to_light[k];
        c += v * v;
    }
    float b = along + q * radius;
    if (!(c > 0 && q < 1) || b <= 0)
        return c > 0 && q < 1;
    return b * b * (1 + 1e-4f) < (1 - q * q) * c;
}
