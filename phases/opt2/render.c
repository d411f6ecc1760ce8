// The phase's entry points (common/phase.h) and its loop over pixels: one ray through the centre of
// each.
#include "phase.h"
#include "trace.h"

#include "scene/prepare_once.h" // needs trace.h

// The unit direction of the ray through the pixel's centre.
static void get_direction(int column, int row, const struct frame *frame, const struct view *view,
                          double *direction) {
    COUNT(get_direction, call);
    double pixel_size = view->tan_half_fov / frame->height;
    double x = (2.0 * column + 1.0 - frame->width) * pixel_size;
    double y = (frame->height - 1.0 - 2.0 * row) * pixel_size;
    for (int i = 0; i < 3; i++)
        direction[i] = view->forward[i] + view->right[i] * x + view->up[i] * y;
    vec_scale(direction, 1.0 / vec_norm(direction), direction);
}

static void store(struct frame *frame, size_t pixel, const struct shaded *seen) {
    frame->rgb[3 * pixel] = (float)seen->color[0];
    frame->rgb[3 * pixel + 1] = (float)seen->color[1];
    frame->rgb[3 * pixel + 2] = (float)seen->color[2];
    if (!frame->depth)
        return;
    frame->depth[pixel] = seen->hit.found ? (float)seen->hit.t : INFINITY;
    frame->id[pixel] = (float)seen->hit.shape;
    frame->normal[3 * pixel] = (float)seen->normal[0];
    frame->normal[3 * pixel + 1] = (float)seen->normal[1];
    frame->normal[3 * pixel + 2] = (float)seen->normal[2];
    frame->evals[pixel] = (float)seen->hit.evals;
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    struct world world = {prepared, view};
    for (int row = 0; row < frame->height; row++) {
        for (int column = 0; column < frame->width; column++) {
            double direction[3];
            struct shaded seen;
            get_direction(column, row, frame, view, direction);
            trace(view->position, direction, 0, &world, &seen);
            store(frame, (size_t)row * (size_t)frame->width + (size_t)column, &seen);
        }
    }
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    for (size_t i = 0; i < count; i++) {
        nearest[i] = -1;
        distance[i] = sdf(points + 3 * i, prepared, &nearest[i]);
    }
    return true;
}
