// The part of the picture's plane at distance 1 that a tile's rays go through.
#ifndef OPT9_TILE_FRUSTUM_H
#define OPT9_TILE_FRUSTUM_H

#include <math.h>
#include <stdbool.h>

struct tile_frustum {
    float left, right, bottom, top;
};

// `normal` in the camera's axes: a ray (x, y, 1) falls towards the plane where its product with it is negative. That, the
// normal and the ray are rounded: by 16·2⁻²⁴ of |x| + |y| + 1 at most, which is 33 at the widest field of view of 16:9.
static inline bool plane_in_frustum(const struct tile_frustum *w, const float normal[3]) {
    float x = normal[0] > 0 ? w->left : w->right, y = normal[1] > 0 ? w->bottom : w->top;
    return normal[0] * x + normal[1] * y + normal[2] < 1e-6f * (1 + fabsf(x) + fabsf(y));
}

#endif
