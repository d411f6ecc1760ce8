// The phase's entry points, a pixel's ray, and the pixel that a finished march gives.
#include <stdlib.h>
#include <string.h>

#include "phase.h"
#include "rods.h"

const char *phase_unsupported(const struct scene *scene) {
    (void)scene;
    static char error[512];
    struct settings settings;
    return settings_read(getenv("STEPWISE_RODS"), &settings, error) ? NULL : error;
}

const char *phase_settings(const struct prepared *prepared) {
    return state_of(prepared)->settings_text;
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    (void)threads; // one
    struct state *state = calloc(1, sizeof *state);
    struct primitive *primitives = calloc((size_t)model->shape_count, sizeof *primitives);
    if (!state || !primitives) {
        free(state);
        free(primitives);
        return NULL;
    }
    state->prepared.primitives = primitives;
    char error[512];
    settings_read(getenv("STEPWISE_RODS"), &state->settings, error);
    settings_say(&state->settings, state->settings_text);
    phase_update(&state->prepared, model);
    return &state->prepared;
}

void phase_release(struct prepared *prepared) {
    free(prepared->primitives);
    free(prepared);
}

void get_direction(double column, double row, const struct frame *frame, const struct view *view,
                   double *direction) {
    double pixel_size = view->tan_half_fov / frame->height;
    double x = (2.0 * column + 1.0 - frame->width) * pixel_size;
    double y = (frame->height - 1.0 - 2.0 * row) * pixel_size;
    for (int i = 0; i < 3; i++)
        direction[i] = view->forward[i] + view->right[i] * x + view->up[i] * y;
    vec_scale(direction, 1.0 / vec_norm(direction), direction);
}

static void store(struct frame *frame, size_t pixel, const struct shaded *result,
                  struct pixel_cost cost) {
    for (int i = 0; i < 3; i++)
        frame->rgb[3 * pixel + (size_t)i] = (float)result->color[i];
    if (!frame->depth)
        return;
    const struct hit *hit = &result->hit;
    frame->depth[pixel] = hit->found ? (float)hit->t : INFINITY;
    frame->id[pixel] = (float)hit->shape;
    for (int i = 0; i < 3; i++)
        frame->normal[3 * pixel + (size_t)i] = (float)result->normal[i];
    frame->evals[pixel] = (float)cost.evals;
    frame->planes[0][pixel] = (float)cost.start;
    frame->planes[1][pixel] = (float)hit->evals;
    frame->planes[2][pixel] = (float)cost.last_t;
    frame->planes[3][pixel] = (float)cost.last_distance;
}

void put_pixel(const struct world *world, struct frame *frame, int column, int row,
               const struct hit *hit, struct pixel_cost cost) {
    size_t pixel = (size_t)row * (size_t)frame->width + (size_t)column;
    struct shaded result = {.hit = *hit};
    if (state_of(world->scene)->settings.map) { // the march alone, as the article draws it
        vec_set((double[3]){cost.last_t, cost.last_distance, hit->evals}, result.color);
    } else {
        double direction[3];
        get_direction(column, row, frame, world->view, direction);
        vec_along(world->view->position, direction, hit->t, result.hit.point);
        shade(direction, 0, world, &result);
    }
    store(frame, pixel, &result, cost);
}

// opt2's ray_march(), which keeps the last point and the distance there.
static void march_pixel(const double *origin, const double *direction, const struct prepared *scene,
                        struct hit *hit, struct pixel_cost *cost) {
    *hit = (struct hit){.shape = -1};
    vec_set(origin, hit->point);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        double distance = scene_distance(hit->point, scene, &hit->shape);
        cost->evals = ++hit->evals;
        cost->last_t = hit->t;
        cost->last_distance = distance;
        hit->t += distance;
        vec_along(origin, direction, hit->t, hit->point);
        if (distance < scene->model.march.hit_distance) {
            hit->found = true;
            return;
        }
        if (vec_norm_sq(hit->point) > scene->bounds_sq)
            break;
    }
    hit->shape = -1;
}

// Marches each pixel by itself: what the article compares rods with.
static void march_pixels(const struct world *world, struct frame *frame) {
    for (int row = 0; row < frame->height; row++)
        for (int column = 0; column < frame->width; column++) {
            double direction[3];
            struct hit hit;
            struct pixel_cost cost = {0};
            get_direction(column, row, frame, world->view, direction);
            march_pixel(world->view->position, direction, world->scene, &hit, &cost);
            put_pixel(world, frame, column, row, &hit, cost);
        }
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    struct world world = {prepared, view};
    if (state_of(prepared)->settings.pixels)
        march_pixels(&world, frame);
    else
        march_rods(&world, frame);
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    for (size_t i = 0; i < count; i++) {
        nearest[i] = -1;
        distance[i] = scene_distance(points + 3 * i, prepared, &nearest[i]);
    }
    return true;
}
