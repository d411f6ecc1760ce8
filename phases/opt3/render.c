// The phase's entry points and its loop over pixels: four neighbours of a row at a time, one ray
// through the middle of each; the last packet of a row is filled up by mask, so any width will do.
#include <stdlib.h>
#include <string.h>

#include "phase.h"
#include "trace.h"

const char *phase_unsupported(const struct scene *scene) {
    (void)scene;
    return NULL;
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

static struct placed place_shape(int index, const struct shape *shape) {
    struct placed p = {.type = shape->type, .index = index};
    memcpy(p.position, shape->position, sizeof p.position);
    rotation_matrix(shape->rotation_degrees, p.turn);
    for (int i = 0; i < 3; i++) {
        p.turned = p.turned || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = shape->repeat[i];
        p.per_cell[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
    }
    switch (shape->type) {
    case SHAPE_SPHERE: p.a = shape->sphere.radius; break;
    case SHAPE_BOX: memcpy(p.size, shape->box.half_size, sizeof p.size); break;
    case SHAPE_ROUNDED_BOX:
        memcpy(p.size, shape->box.half_size, sizeof p.size);
        p.a = shape->box.rounding;
        break;
    case SHAPE_TORUS:
        p.a = shape->torus.major_radius;
        p.b = shape->torus.minor_radius;
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
        memcpy(p.size, shape->plane.normal, sizeof p.size);
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
        prepared->placed[i] = place_shape(i, &model->shapes[i]);
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
    phase_update(prepared, model);
    return prepared;
}

void phase_release(struct prepared *prepared) {
    free(prepared->placed);
    free(prepared);
}

static struct vec get_direction(int column, int row, const struct frame *frame,
                                const struct view *view) {
    COUNT(get_direction, call);
    COUNT(get_direction, scalar);
    double per_height = view->tan_half_fov / frame->height;
    real columns = _mm256_setr_pd(column, column + 1, column + 2, column + 3);
    real x = mul_add(set(2.0), columns, set(1.0 - frame->width)) * set(per_height);
    real y = set((frame->height - 1.0 - 2.0 * row) * per_height);
    struct vec d = vec_along(vec_set(view->forward), vec_set(view->right), x);
    d = vec_along(d, vec_set(view->up), y);
    return vec_scale(d, set(1.0) / vec_norm(d));
}

static void store_plane(float *plane, int stride, int count, real values) {
    float lanes[LANES];
    _mm_storeu_ps(lanes, _mm256_cvtpd_ps(values));
    for (int lane = 0; lane < count; lane++)
        plane[lane * stride] = lanes[lane];
}

static void store(struct frame *frame, size_t pixel, int count, const struct shaded *seen) {
    COUNT(store, call);
    float *rgb = frame->rgb + 3 * pixel;
    store_plane(rgb, 3, count, seen->color.x);
    store_plane(rgb + 1, 3, count, seen->color.y);
    store_plane(rgb + 2, 3, count, seen->color.z);
    if (!frame->depth)
        return;
    float *normal = frame->normal + 3 * pixel;
    store_plane(frame->depth + pixel, 1, count,
                choose(seen->hit.found, seen->hit.t, set(INFINITY)));
    store_plane(frame->id + pixel, 1, count, seen->hit.shape);
    store_plane(normal, 3, count, seen->normal.x);
    store_plane(normal + 1, 3, count, seen->normal.y);
    store_plane(normal + 2, 3, count, seen->normal.z);
    store_plane(frame->evals + pixel, 1, count, seen->hit.evals);
}

// Lanes below `count`.
static mask first_lanes(int count) {
    return less(_mm256_setr_pd(0, 1, 2, 3), set(count));
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    COUNT(phase_render, call);
    struct world world = {prepared, view};
    struct vec origin = vec_set(view->position);
    for (int row = 0; row < frame->height; row++) {
        for (int column = 0; column < frame->width; column += LANES) {
            int count = frame->width - column < LANES ? frame->width - column : LANES;
            ACTIVE(count);
            COUNT(phase_render, packet);
            struct shaded seen;
            trace(origin, get_direction(column, row, frame, view), first_lanes(count), 0, &world,
                  &seen);
            ACTIVE(count);
            store(frame, (size_t)row * (size_t)frame->width + (size_t)column, count, &seen);
        }
    }
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    for (size_t i = 0; i < count; i++) {
        real shape = set(-1.0);
        real h = sdf(vec_set(points + 3 * i), prepared, set(0.0), &shape);
        distance[i] = _mm256_cvtsd_f64(h);
        nearest[i] = (int)_mm256_cvtsd_f64(shape);
    }
    return true;
}
