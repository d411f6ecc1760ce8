// The phase's entry points, a pixel's ray, and the pixel that a finished march gives.
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
    return prepared->settings_text;
}

// The rotation about x, then y, then z as one matrix: (u, v) becomes (c·u − s·v, s·u + c·v) on (y,z), then (x,z),
// then (x,y).
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

static struct primitive make_primitive(const struct shape *shape) {
    struct primitive p = {.type = shape->type};
    vec_set(shape->position, p.position);
    rotation_matrix(shape->rotation_degrees, p.rotation);
    for (int i = 0; i < 3; i++) {
        p.rotated = p.rotated || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = shape->repeat[i];
        p.inv_cell[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
    }
    switch (shape->type) {
    case SHAPE_SPHERE: p.sphere.radius = shape->sphere.radius; break;
    case SHAPE_BOX: vec_set(shape->box.half_size, p.box.half_size); break;
    case SHAPE_ROUNDED_BOX:
        vec_set(shape->box.half_size, p.box.half_size);
        p.box.rounding = shape->box.rounding;
        break;
    case SHAPE_TORUS:
        p.torus.major_radius = shape->torus.major_radius;
        p.torus.minor_radius = shape->torus.minor_radius;
        break;
    case SHAPE_CONE:
        p.cone.bottom_radius = shape->cone.bottom_radius;
        p.cone.top_radius = shape->cone.top_radius;
        p.cone.half_height = shape->cone.half_height;
        p.cone.side[0] = p.cone.top_radius - p.cone.bottom_radius;
        p.cone.side[1] = 2.0 * p.cone.half_height;
        p.cone.inv_side_sq =
            1.0 / (p.cone.side[0] * p.cone.side[0] + p.cone.side[1] * p.cone.side[1]);
        break;
    case SHAPE_OCTAHEDRON: p.octahedron.radius = shape->octahedron.radius; break;
    case SHAPE_PLANE:
        vec_set(shape->plane.normal, p.plane.normal);
        p.plane.offset = shape->plane.offset;
        break;
    case SHAPE_MANDELBOX:
        p.mandelbox.scale = shape->mandelbox.scale;
        p.mandelbox.fold_limit = shape->mandelbox.fold_limit;
        p.mandelbox.inner_sq = shape->mandelbox.minimum_radius * shape->mandelbox.minimum_radius;
        p.mandelbox.outer_sq = shape->mandelbox.fixed_radius * shape->mandelbox.fixed_radius;
        p.mandelbox.iterations = shape->mandelbox.iterations;
        break;
    default:
        p.mandelbulb.bailout = shape->mandelbulb.bailout;
        p.mandelbulb.iterations = shape->mandelbulb.iterations;
        break;
    }
    return p;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    prepared->bounds_sq = model->march.bounds_radius * model->march.bounds_radius;
    for (int i = 0; i < model->shape_count; i++)
        prepared->primitives[i] = make_primitive(&model->shapes[i]);
    return true;
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    (void)threads; // one
    struct prepared *prepared = calloc(1, sizeof *prepared);
    struct primitive *primitives = calloc((size_t)model->shape_count, sizeof *primitives);
    if (!prepared || !primitives) {
        free(prepared);
        free(primitives);
        return NULL;
    }
    prepared->primitives = primitives;
    char error[512];
    settings_read(getenv("STEPWISE_RODS"), &prepared->settings, error);
    settings_say(&prepared->settings, prepared->settings_text);
    phase_update(prepared, model);
    return prepared;
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
    frame->planes[2][pixel] = (float)hit->last_t;
    frame->planes[3][pixel] = (float)hit->last_distance;
}

void put_pixel(const struct scene_view *input, struct frame *frame, int column, int row,
               const struct hit *hit, struct pixel_cost cost) {
    size_t pixel = (size_t)row * (size_t)frame->width + (size_t)column;
    struct shaded result = {.hit = *hit};
    if (input->scene->settings.map) { // the march alone, as the article draws it
        vec_set((double[3]){hit->last_t, hit->last_distance, hit->evals}, result.color);
    } else {
        double direction[3];
        get_direction(column, row, frame, input->view, direction);
        vec_along(input->view->position, direction, hit->t, result.hit.point);
        shade(direction, 0, input, &result);
    }
    store(frame, pixel, &result, cost);
}

// Marches each pixel by itself: what the article compares rods with.
static void march_pixels(const struct scene_view *input, struct frame *frame) {
    for (int row = 0; row < frame->height; row++)
        for (int column = 0; column < frame->width; column++) {
            double direction[3];
            struct hit hit;
            get_direction(column, row, frame, input->view, direction);
            ray_march(input->view->position, direction, input->scene, &hit);
            put_pixel(input, frame, column, row, &hit, (struct pixel_cost){hit.evals, 0.0});
        }
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    struct scene_view input = {prepared, view};
    if (prepared->settings.pixels)
        march_pixels(&input, frame);
    else
        march_rods(&input, frame);
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
