// The phase's entry points: camera rays as intervals about the exact rational direction, and tiles that workers share.
#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "bulb/bulb_hit.h"
#include "number/sine.h"
#include "phase.h"
#include "trace.h"
#include "workers/workers.h"

enum { TILE = 16 };

// Whether two shapes are the same surface. The first in the scene then owns every hit, as in every phase's ties.
static bool same_surface(const struct shape *a, const struct shape *b) {
    struct shape x = *a, y = *b;
    x.material = y.material = 0;
    memset(&x.path, 0, sizeof x.path);
    memset(&y.path, 0, sizeof y.path);
    return !is_fractal(a->type) && a->type != SHAPE_GROUP && memcmp(&x, &y, sizeof x) == 0;
}

// The rotation about x, then y, then z as one matrix.
static void rotation_matrix(const double degrees[3], struct ivq turn[3][3]) {
    static const int pair[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            turn[i][j] = point_q(i == j);
    for (int axis = 0; axis < 3; axis++) {
        struct ivq s, c;
        sine_cosine_q(degrees[axis], &s, &c);
        struct ivq *u = turn[pair[axis][0]], *v = turn[pair[axis][1]];
        for (int j = 0; j < 3; j++) {
            struct ivq p = u[j], q = v[j];
            u[j] = sub_q(mul_q(c, p), mul_q(s, q));
            v[j] = add_q(mul_q(s, p), mul_q(c, q));
        }
    }
}

static void prepare_solid(struct solid *solid, const struct model *model,
                          const struct shape *shape) {
    *solid = (struct solid){.shape = shape, .nodes = model->nodes};
    for (int i = 0; i < 3; i++) {
        solid->rotated = solid->rotated || shape->rotation_degrees[i] != 0;
        solid->repeated = solid->repeated || shape->repeat[i] > 0;
    }
    rotation_matrix(shape->rotation_degrees, solid->rotation_q);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            solid->rotation_d[i][j] = narrow(solid->rotation_q[i][j]);
            solid->rotation[i][j] = dd_from_quad(mid_q(solid->rotation_q[i][j]));
        }
}

static bool prepare(struct prepared *prepared, const struct model *model) {
    int count = model->shape_count;
    struct solid *solids = malloc((size_t)(count + model->node_count) * sizeof *solids);
    if (!solids)
        return false;
    for (int i = 0; i < count; i++) {
        prepare_solid(&solids[i], model, &model->shapes[i]);
        solids[i].inside = solids + count;
        for (int j = 0; j < i && !solids[i].duplicate; j++)
            solids[i].duplicate = same_surface(&model->shapes[j], &model->shapes[i]);
    }
    for (int i = 0; i < model->node_count; i++)
        prepare_solid(&solids[count + i], model, &model->nodes[i].shape);
    free(prepared->solids);
    prepared->solids = solids;
    prepared->model = *model;
    prepared->fractals =
        model->features.count[SHAPE_MANDELBULB] > 0 || model->features.count[SHAPE_MANDELBOX] > 0;
    prepared->provable = prepared->fractals && model->features.count[SHAPE_MANDELBOX] == 0;
    return true;
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct prepared *prepared = calloc(1, sizeof *prepared);
    if (!prepared)
        return NULL;
    if (prepare(prepared, model))
        prepared->workers = workers_start(threads, 0);
    if (prepared->workers)
        return prepared;
    phase_release(prepared);
    return NULL;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    return prepare(prepared, model);
}

void phase_release(struct prepared *prepared) {
    workers_end(prepared->workers);
    free(prepared->solids);
    free(prepared);
}

// The exact ray through the middle of the pixel. 2·column + 1 − width times a double is exact in quad.
static void camera_ray(const struct view *view, const struct frame *frame, int column, int row,
                       struct ray_q *ray) {
    struct ivq tangent = point_q(view->tan_half_fov), height = point_q(frame->height);
    struct ivq x = div_q(mul_q(point_q(2.0 * column + 1 - frame->width), tangent), height);
    struct ivq y = div_q(mul_q(point_q(frame->height - 2.0 * row - 1), tangent), height);
    for (int i = 0; i < 3; i++) {
        ray->o[i] = point_q(view->position[i]);
        ray->d[i] = add_q(add_q(point_q(view->forward[i]), mul_q(point_q(view->right[i]), x)),
                          mul_q(point_q(view->up[i]), y));
    }
}

// Rounded up. The width of a ray that may never leave a half-space is FLT_MAX.
static float width_of(const struct hit *hit) {
    quad width = hit->t.hi - hit->t.lo;
    bool none = hit->shape < 0 && hit->status != UNDECIDED;
    float above = width < FLT_MAX ? nextafterf((float)width, INFINITY) : FLT_MAX;
    return none ? 0 : above;
}

static void store(struct frame *frame, size_t pixel, const struct shaded *result) {
    const struct hit *hit = &result->hit;
    bool found = hit->shape >= 0;
    for (int i = 0; i < 3; i++)
        frame->rgb[3 * pixel + (size_t)i] = (float)result->color[SHADOW_ESTIMATE][i];
    if (!frame->depth)
        return;
    frame->depth[pixel] = found ? (float)hit->shown_t : INFINITY;
    frame->id[pixel] = (float)hit->shape;
    for (int i = 0; i < 3; i++)
        frame->normal[3 * pixel + (size_t)i] = found ? (float)mid_q(hit->normal[i]) : 0;
    frame->evals[pixel] = (float)hit->evals;
    if (frame->plane_count == 0)
        return;
    for (int i = 0; i < 3; i++) {
        frame->planes[PLANE_IDEAL + i][pixel] = (float)result->color[SHADOW_IDEAL][i];
        frame->planes[PLANE_NONE + i][pixel] = (float)result->color[SHADOW_NONE][i];
    }
    frame->planes[PLANE_SHADOW][pixel] = (float)result->shadow[SHADOW_ESTIMATE];
    frame->planes[PLANE_SHADOW_IDEAL][pixel] = (float)result->shadow[SHADOW_IDEAL];
    frame->planes[PLANE_WIDTH][pixel] = width_of(hit);
    frame->planes[PLANE_STATUS][pixel] = (float)hit->status;
    frame->planes[PLANE_STATUS_ALL][pixel] = (float)result->status_all;
}

// The pixel of the exact surface. Its colour is NaN where a ray that it depends on is undecided.
static void store_surface(const struct prepared *exact, struct frame *frame, size_t pixel,
                          const struct shaded *result) {
    const struct hit *hit = &result->hit;
    bool known = result->status_all != UNDECIDED, found = hit->shape >= 0;
    double n[3] = {0, 0, 0};
    if (found && is_fractal(exact->model.shapes[hit->shape].type))
        bulb_normal(&exact->solids[hit->shape], hit->point, n);
    for (int i = 0; i < 3; i++) {
        frame->planes[PLANE_SURFACE_NORMAL + i][pixel] = (float)n[i];
        frame->planes[PLANE_SURFACE + i][pixel] =
            known ? (float)result->color[SHADOW_ESTIMATE][i] : NAN;
        frame->planes[PLANE_SURFACE_IDEAL + i][pixel] =
            known ? (float)result->color[SHADOW_IDEAL][i] : NAN;
    }
    frame->planes[PLANE_SURFACE_Z][pixel] = found ? (float)hit->shown_t : INFINITY;
    frame->planes[PLANE_SURFACE_ID][pixel] = (float)hit->shape;
    frame->planes[PLANE_SURFACE_STATUS][pixel] = (float)hit->status;
    frame->planes[PLANE_SURFACE_WIDTH][pixel] = width_of(hit);
}

struct job {
    const struct prepared *prepared;
    const struct view *view;
    struct frame *frame;
};

static int tiles(int pixels) {
    return (pixels + TILE - 1) / TILE;
}

static void render_tile(const void *data, int tile, void *scratch) {
    (void)scratch;
    const struct job *job = data;
    struct frame *frame = job->frame;
    struct prepared exact = *job->prepared;
    exact.exact = true;
    int left = tile % tiles(frame->width) * TILE, top = tile / tiles(frame->width) * TILE;
    for (int row = top; row < top + TILE && row < frame->height; row++)
        for (int column = left; column < left + TILE && column < frame->width; column++) {
            struct ray_q ray;
            struct shaded result;
            camera_ray(job->view, frame, column, row, &ray);
            trace(job->prepared, job->view, &ray, 0, &result);
            size_t pixel = (size_t)row * (size_t)frame->width + (size_t)column;
            store(frame, pixel, &result);
            if (frame->plane_count > 0 && exact.provable) {
                trace(&exact, job->view, &ray, 0, &result);
                store_surface(&exact, frame, pixel, &result);
            } else if (frame->plane_count > 0)
                for (int i = PLANE_SURFACE; i <= PLANE_SURFACE_WIDTH; i++)
                    frame->planes[i][pixel] = 0;
        }
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    struct job job = {.prepared = prepared, .view = view, .frame = frame};
    workers_run(prepared->workers, render_tile, &job, tiles(frame->width) * tiles(frame->height));
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    for (size_t i = 0; i < count; i++) {
        struct dd p[3];
        for (int j = 0; j < 3; j++)
            p[j] = dd_from(points[3 * i + (size_t)j]);
        nearest[i] = -1;
        distance[i] = distance_to_scene(prepared, p, false, &nearest[i]).hi;
    }
    return true;
}

bool phase_enclosures(const struct prepared *prepared, size_t count, const double *rays,
                      double *enclosures) {
    struct prepared exact = *prepared;
    exact.exact = prepared->provable;
    for (size_t i = 0; i < count; i++) {
        const double *from = rays + 6 * i;
        double *to = enclosures + 5 * i;
        struct ray_q ray;
        struct hit hit = {.shape = -1};
        bool finite = true;
        for (int j = 0; j < 3; j++) {
            finite = finite && isfinite(from[j]) && isfinite(from[j + 3]);
            ray.o[j] = point_q(from[j]);
            ray.d[j] = point_q(from[j + 3]);
        }
        if (finite)
            find_hit(&exact, &ray, &hit);
        bool miss = hit.shape < 0 && hit.status != UNDECIDED;
        to[0] = hit.status;
        to[1] = hit.shape;
        to[2] = miss ? INFINITY : double_below(hit.s.lo);
        to[3] = miss ? INFINITY : double_above(hit.s.hi);
        to[4] = (double)hit.evals;
    }
    return true;
}
