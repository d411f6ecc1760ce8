// Cones around the camera rays of rectangles of pixels.
#include "cones/pixel_cones.h"
#include "cones/tile_cones.h"
#include "core/kernel.h"

static struct vec unit(struct vec v) {
    return vec_scale(v, v_splat(1.0f) / vec_norm(v));
}

// Returns a cone in each lane that holds the rays of a rectangle of pixels. It is made from the rays through the middles
// of the corner pixels. No other ray is further from the axis: a circle around the axis is an ellipse in the picture,
// which is convex.
static struct cone_packet cones_around(vfloat x[2], vfloat y[2], const struct view *view) {
    struct vec corner[4], sum = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (int i = 0; i < 4; i++) {
        corner[i] =
            vec_along(vec_from_doubles(view->forward), vec_from_doubles(view->right), x[i & 1]);
        corner[i] = unit(vec_along(corner[i], vec_from_doubles(view->up), y[i >> 1]));
        sum = vec_along(sum, corner[i], v_splat(1.0f));
    }
    struct cone_packet cones = {.axis = unit(sum)};
    vfloat most = v_splat(0.0f);
    for (int i = 0; i < 4; i++) {
        struct vec apart = vec_along(corner[i], cones.axis, v_splat(-1.0f));
        most = v_max(most, vec_dot(apart, apart));
    }
    cones.spread = v_madd(v_sqrt(most), v_splat(1.0f + 0x1p-16f), v_splat(0x1p-20f));
    return cones;
}

// Sets a cone for each rectangle. Returns which rectangles hold a pixel of the picture.
vmask get_cones(const struct pixel_rect patches[LANES], const struct job *job,
                struct cone_packet *cones) {
    const struct frame *frame = job->frame;
    double per_height = job->view->tan_half_fov / frame->height;
    float edge[4][LANES], there[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        struct pixel_rect p = patches[lane];
        there[lane] = p.left < p.right && p.top < p.bottom ? 1.0f : 0.0f;
        edge[0][lane] = (float)((2.0 * p.left + 1.0 - frame->width) * per_height);
        edge[1][lane] = (float)((2.0 * p.right - 1.0 - frame->width) * per_height);
        edge[2][lane] = (float)((frame->height - 1.0 - 2.0 * p.top) * per_height);
        edge[3][lane] = (float)((frame->height + 1.0 - 2.0 * p.bottom) * per_height);
    }
    vfloat x[2] = {v_load(edge[0]), v_load(edge[1])}, y[2] = {v_load(edge[2]), v_load(edge[3])};
    *cones = cones_around(x, y, job->view);
    return v_cmp_gt(v_load(there), v_splat(0.5f));
}
