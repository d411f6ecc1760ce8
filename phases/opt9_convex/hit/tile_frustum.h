// The rectangle of the picture's plane, at distance 1, that a tile's rays pass.
#pragma once

#include <math.h>
#include <stdbool.h>

struct tile_frustum {
    float left, right, bottom, top;
};

// Returns whether a ray (x, y, 1) of the tile can fall towards a plane: where its product with the normal, in
// camera axes, is negative. The margin covers rounding, 16·2⁻²⁴ of |x| + |y| + 1 at most.
static inline bool plane_in_frustum(const struct tile_frustum *w, const float normal[3]) {
    float x = normal[0] > 0 ? w->left : w->right, y = normal[1] > 0 ? w->bottom : w->top;
    return normal[0] * x + normal[1] * y + normal[2] < 1e-6f * (1 + fabsf(x) + fabsf(y));
}
