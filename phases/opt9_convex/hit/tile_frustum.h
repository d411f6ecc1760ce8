// The rectangle of the picture's plane, at distance 1, that a tile's rays pass.
#pragma once

#include <math.h>
#include <stdbool.h>

struct tile_frustum {
    float left, right, bottom, top;
};

// Returns whether a sphere, in camera axes, meets the frustum. sides: lengths of the normals of its sides.
static inline bool ball_in_frustum(const struct tile_frustum *w, const float sides[4],
                                   const float c[3], float radius) {
    float r = radius * (1 + 1e-5f) + 1e-6f * (fabsf(c[0]) + fabsf(c[1]) + fabsf(c[2]));
    return c[2] > -r && w->left * c[2] - c[0] < r * sides[0] &&
           c[0] - w->right * c[2] < r * sides[1] && w->bottom * c[2] - c[1] < r * sides[2] &&
           c[1] - w->top * c[2] < r * sides[3];
}

// Returns whether a ray (x, y, 1) of the tile can fall towards a plane: where its product with the normal, in
// camera axes, is negative. The margin covers rounding, 16·2⁻²⁴ of |x| + |y| + 1 at most.
static inline bool plane_in_frustum(const struct tile_frustum *w, const float normal[3]) {
    float x = normal[0] > 0 ? w->left : w->right, y = normal[1] > 0 ? w->bottom : w->top;
    return normal[0] * x + normal[1] * y + normal[2] < 1e-6f * (1 + fabsf(x) + fabsf(y));
}
