// The phase's entry points (common/phase.h) and its loop over pixels: one ray through the centre of
// each.
#include <stdlib.h>

#include "phase.h"
#include "trace.h"

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    group_prepare(model, prepared->nodes);
    for (int i = 0; i < model->shape_count; i++) {
        struct primitive *primitive = &prepared->primitives[i];
        const struct shape *shape = &model->shapes[i];
        *primitive = (struct primitive){.shape = *shape, .nodes = prepared->nodes};
        primitive->position =
            (struct vec3){shape->position[0], shape->position[1], shape->position[2]};
        for (int axis = 0; axis < 3; axis++) {
            double radians = shape->rotation_degrees[axis] * (M_PI / 180.0);
            primitive->cosine[axis] = cos(radians);
            primitive->sine[axis] = sin(radians);
            primitive->rotated[axis] = radians != 0.0;
            primitive->repeated = primitive->repeated || shape->repeat[axis] > 0.0;
        }
    }
    return true;
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    (void)threads; // one
    size_t shapes = (size_t)model->shape_count, nodes = (size_t)model->node_count;
    struct prepared *prepared = calloc(1, sizeof *prepared + shapes * sizeof *prepared->primitives +
                                              nodes * sizeof *prepared->nodes);
    if (!prepared)
        return NULL;
    prepared->primitives = (struct primitive *)(prepared + 1);
    prepared->nodes = (struct group_node *)(prepared->primitives + shapes);
    phase_update(prepared, model);
    return prepared;
}

void phase_release(struct prepared *prepared) {
    free(prepared);
}

// The unit direction of the ray through the pixel's centre.
static void get_direction(int column, int row, const struct frame *frame, const struct view *view,
                          struct vec3 *direction) {
    COUNT(get_direction, call);
    int width = frame->width, height = frame->height;
    double x = (2.0 * (column + 0.5) / width - 1.0) * width / height * view->tan_half_fov;
    double y = (1.0 - 2.0 * (row + 0.5) / height) * view->tan_half_fov;
    const double *f = view->forward, *r = view->right, *u = view->up;
    struct vec3 d = {f[0] + r[0] * x + u[0] * y, f[1] + r[1] * x + u[1] * y,
                     f[2] + r[2] * x + u[2] * y};
    vec_normalize(&d, direction);
}

static void store(struct frame *frame, size_t pixel, const struct shaded *seen) {
    frame->rgb[3 * pixel] = (float)seen->color.x;
    frame->rgb[3 * pixel + 1] = (float)seen->color.y;
    frame->rgb[3 * pixel + 2] = (float)seen->color.z;
    if (!frame->depth)
        return;
    frame->depth[pixel] = seen->hit.found ? (float)seen->hit.t : INFINITY;
    frame->id[pixel] = (float)seen->hit.shape;
    frame->normal[3 * pixel] = (float)seen->normal.x;
    frame->normal[3 * pixel + 1] = (float)seen->normal.y;
    frame->normal[3 * pixel + 2] = (float)seen->normal.z;
    frame->evals[pixel] = (float)seen->hit.evals;
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    struct world world = {prepared, view};
    struct vec3 origin = {view->position[0], view->position[1], view->position[2]};
    for (int row = 0; row < frame->height; row++) {
        for (int column = 0; column < frame->width; column++) {
            struct vec3 direction;
            struct shaded seen;
            get_direction(column, row, frame, view, &direction);
            trace(&origin, &direction, 0, &world, &seen);
            store(frame, (size_t)row * (size_t)frame->width + (size_t)column, &seen);
        }
    }
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    for (size_t i = 0; i < count; i++) {
        struct vec3 p = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
        nearest[i] = -1;
        distance[i] = sdf(&p, prepared, &nearest[i]);
    }
    return true;
}
