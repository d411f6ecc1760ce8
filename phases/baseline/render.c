// The phase's entry points (common/phase.h) and its loop over pixels: one ray through the centre of
// each.
#include <stdlib.h>

#include "phase.h"
#include "trace.h"

struct prepared {
    struct model model;
};

struct prepared *phase_prepare(const struct model *model, int threads) {
    (void)threads; // one
    struct prepared *prepared = malloc(sizeof *prepared);
    if (prepared)
        prepared->model = *model;
    return prepared;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    return true;
}

void phase_release(struct prepared *prepared) {
    free(prepared);
}

// The unit direction of the ray through the pixel's centre.
static struct vec3 get_direction(int column, int row, int width, int height, struct view view) {
    COUNT(get_direction, call);
    double x = (2.0 * (column + 0.5) / width - 1.0) * width / height * view.tan_half_fov;
    double y = (1.0 - 2.0 * (row + 0.5) / height) * view.tan_half_fov;
    struct vec3 d = *vec_at(view.forward);
    d = vec_add(d, vec_scale(*vec_at(view.right), x));
    d = vec_add(d, vec_scale(*vec_at(view.up), y));
    return vec_normalize(d);
}

static struct world world_of(const struct model *model, const struct view *view) {
    return (struct world){model->shape_count, model->shapes, model, view};
}

static void store(struct frame *frame, size_t pixel, struct shaded seen) {
    frame->rgb[3 * pixel] = (float)seen.color.x;
    frame->rgb[3 * pixel + 1] = (float)seen.color.y;
    frame->rgb[3 * pixel + 2] = (float)seen.color.z;
    if (!frame->depth)
        return;
    frame->depth[pixel] = seen.hit.found ? (float)seen.hit.t : INFINITY;
    frame->id[pixel] = (float)seen.hit.shape;
    frame->normal[3 * pixel] = (float)seen.normal.x;
    frame->normal[3 * pixel + 1] = (float)seen.normal.y;
    frame->normal[3 * pixel + 2] = (float)seen.normal.z;
    frame->evals[pixel] = (float)seen.hit.evals;
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    struct world world = world_of(&prepared->model, view);
    struct vec3 origin = *vec_at(view->position);
    for (int row = 0; row < frame->height; row++) {
        for (int column = 0; column < frame->width; column++) {
            struct vec3 direction = get_direction(column, row, frame->width, frame->height, *view);
            store(frame, (size_t)row * (size_t)frame->width + (size_t)column,
                  trace(origin, direction, 0, world));
        }
    }
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    struct world world = world_of(&prepared->model, NULL);
    for (size_t i = 0; i < count; i++) {
        nearest[i] = -1;
        distance[i] = sdf(*vec_at(points + 3 * i), world, &nearest[i]);
    }
    return true;
}
