// The phase's entry points, what a pixel's own ray is, and what becomes of it when its march has ended.
#include <stdlib.h>
#include <string.h>

#include "phase.h"
#include "trace.h"

const char *phase_unsupported(const struct scene *scene) {
    (void)scene;
    static char error[512];
    struct settings settings;
    return settings_read(getenv("STEPWISE_RODS"), &settings, error) ? NULL : error;
}

const char *phase_settings(const struct prepared *prepared) {
    return prepared->said;
}

// Rotation about x, then y, then z as one matrix: (u, v) turns to (c·u − s·v, s·u + c·v) on (y,z),
// then (x,z), then (x,y).
static void rotation_matrix(const double *degrees, double m[3][3]) {
    static const int pair[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    memcpy(m, (double[3][3]){{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 9 * sizeof(double));
    for (int axis = 0; axis < 3; axis++) {
        double radians = degrees[axis] * (M_PI / 180.0), c = cos(radians), s = sin(radians);
        for (int k = 0; k < 3; k++) {
            double *u = &m[pair[axis][0]][k], *v = &m[pair[axis][1]][k], old = *u;
            *u = c * old - s * *v;
            *v = s * old + c * *v;
        }
    }
}

static struct placed place_shape(const struct shape *shape) {
    struct placed p = {.type = shape->type};
    vec_set(shape->position, p.position);
    rotation_matrix(shape->rotation_degrees, p.turn);
    for (int i = 0; i < 3; i++) {
        p.turned = p.turned || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = shape->repeat[i];
        p.per_cell[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
    }
    switch (shape->type) {
    case SHAPE_SPHERE: p.a = shape->sphere.radius; break;
    case SHAPE_BOX: vec_set(shape->box.half_size, p.size); break;
    case SHAPE_TORUS:
        p.a = shape->torus.major_radius;
        p.b = shape->torus.minor_radius;
        break;
    case SHAPE_ROUNDED_BOX:
        memcpy(p.size, shape->box.half_size, sizeof shape->box.half_size);
        p.a = shape->box.rounding;
        break;
    case SHAPE_CONE:
        p.a = shape->cone.bottom_radius;
        p.b = shape->cone.top_radius;
        p.c = shape->cone.half_height;
        p.slope[0] = p.b - p.a;
        p.slope[1] = 2.0 * p.c;
        p.per_slope_sq = 1.0 / (p.slope[0] * p.slope[0] + p.slope[1] * p.slope[1]);
        break;
    case SHAPE_OCTAHEDRON: p.a = shape->octahedron.radius; break;
    case SHAPE_PLANE:
        vec_set(shape->plane.normal, p.size);
        p.a = shape->plane.offset;
        break;
    default:
        p.bailout = shape->mandelbulb.bailout;
        p.iterations = shape->mandelbulb.iterations;
        break;
    }
    return p;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    prepared->bounds_sq = model->march.bounds_radius * model->march.bounds_radius;
    for (int i = 0; i < model->shape_count; i++)
        prepared->placed[i] = place_shape(&model->shapes[i]);
    return true;
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    (void)threads; // one
    struct prepared *prepared = calloc(1, sizeof *prepared);
    struct placed *placed = calloc((size_t)model->shape_count, sizeof *placed);
    if (!prepared || !placed) {
        free(prepared);
        free(placed);
        return NULL;
    }
    prepared->placed = placed;
    char error[512];
    settings_read(getenv("STEPWISE_RODS"), &prepared->settings, error);
    settings_say(&prepared->settings, prepared->said);
    phase_update(prepared, model);
    return prepared;
}

void phase_release(struct prepared *prepared) {
    free(prepared->placed);
    free(prepared);
}

void get_direction(double column, double row, const struct frame *frame, const struct view *view,
                   double *direction) {
    COUNT(get_direction, call);
    double per_height = view->tan_half_fov / frame->height;
    double x = (2.0 * column + 1.0 - frame->width) * per_height;
    double y = (frame->height - 1.0 - 2.0 * row) * per_height;
    for (int i = 0; i < 3; i++)
        direction[i] = view->forward[i] + view->right[i] * x + view->up[i] * y;
    vec_scale(direction, 1.0 / vec_norm(direction), direction);
}

static void store(struct frame *frame, size_t pixel, const struct shaded *seen,
                  struct share share) {
    for (int i = 0; i < 3; i++)
        frame->rgb[3 * pixel + (size_t)i] = (float)seen->color[i];
    if (!frame->depth)
        return;
    const struct hit *hit = &seen->hit;
    frame->depth[pixel] = hit->found ? (float)hit->t : INFINITY;
    frame->id[pixel] = (float)hit->shape;
    for (int i = 0; i < 3; i++)
        frame->normal[3 * pixel + (size_t)i] = (float)seen->normal[i];
    frame->evals[pixel] = (float)share.evaluated;
    frame->planes[0][pixel] = (float)share.start;
    frame->planes[1][pixel] = (float)hit->evals;
    frame->planes[2][pixel] = (float)hit->last;
    frame->planes[3][pixel] = (float)hit->left;
}

void put_pixel(const struct world *world, struct frame *frame, int column, int row,
               const struct hit *hit, struct share share) {
    size_t pixel = (size_t)row * (size_t)frame->width + (size_t)column;
    struct shaded seen = {.hit = *hit};
    if (world->scene->settings.map) { // the march alone, which is all that the article draws
        vec_set((double[3]){hit->last, hit->left, hit->evals}, seen.color);
    } else {
        double direction[3];
        get_direction(column, row, frame, world->view, direction);
        COUNT(put_pixel, call);
        vec_along(world->view->position, direction, hit->t, seen.hit.point);
        shade(direction, 0, world, &seen);
    }
    store(frame, pixel, &seen, share);
}

// What the article sets rods against.
static void march_pixels(const struct world *world, struct frame *frame) {
    for (int row = 0; row < frame->height; row++)
        for (int column = 0; column < frame->width; column++) {
            double direction[3];
            struct hit hit;
            get_direction(column, row, frame, world->view, direction);
            ray_march(world->view->position, direction, world->scene, &hit);
            put_pixel(world, frame, column, row, &hit, (struct share){hit.evals, 0.0});
        }
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    struct world world = {prepared, view};
    if (prepared->settings.pixels)
        march_pixels(&world, frame);
    else
        march_rods(&world, frame);
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
