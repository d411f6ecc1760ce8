// The phase's entry points and its loop over pixels: eight neighbours of a row at a time, one ray
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

static void to_floats(const double from[3], float to[3]) {
    for (int i = 0; i < 3; i++)
        to[i] = (float)from[i];
}

// See struct placed. A plane that is not repeated has one row.
static void place_rows(struct placed *p, const struct shape *shape, double turn[3][3]) {
    bool linear = p->way == LINEAR;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double *n = shape->plane.normal;
            p->row[i][j] =
                linear ? n[0] * turn[0][j] + n[1] * turn[1][j] + n[2] * turn[2][j] : turn[i][j];
        }
        p->centre[i] = shape->position[i];
    }
    if (p->way == POWER) {
        p->radius_sq = shape->sphere.radius * shape->sphere.radius;
        p->b = (float)p->radius_sq;
    }
    if (linear) {
        p->offset = shape->plane.offset;
        to_floats(p->row[0], p->normal);
    }
}

// Of a sphere wider than the bounds only a piece is seen, from nearer than its radius, so that its
// power is as exact as a point would be, and much more so near the surface. Elsewhere a point is
// cheaper, and from many radii away more exact. 1e15: its square is a float.
static enum way way_of(const struct shape *shape, bool repeated, const struct limits *limits) {
    if (repeated)
        return AT_POINT;
    if (shape->type == SHAPE_SPHERE && shape->sphere.radius >= limits->bounds_radius &&
        shape->sphere.radius < 1e15)
        return POWER;
    return shape->type == SHAPE_PLANE ? LINEAR : AT_POINT;
}

static struct placed place_shape(int index, const struct shape *shape,
                                 const struct limits *limits) {
    struct placed p = {.type = shape->type, .index = (float)index};
    double turn[3][3];
    rotation_matrix(shape->rotation_degrees, turn);
    for (int i = 0; i < 3; i++) {
        split(shape->position[i], &p.position[i], &p.position_lo[i]);
        to_floats(turn[i], p.turn[i]);
        p.turned = p.turned || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = (float)shape->repeat[i];
        p.wide_cell[i] = shape->repeat[i];
        p.wide_per_cell[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
        p.per_cell[i] = (float)p.wide_per_cell[i];
    }
    p.way = way_of(shape, p.repeated, limits);
    place_rows(&p, shape, turn);
    switch (shape->type) {
    case SHAPE_SPHERE: p.a = (float)shape->sphere.radius; break;
    case SHAPE_BOX: to_floats(shape->box.half_size, p.size); break;
    case SHAPE_ROUNDED_BOX:
        to_floats(shape->box.half_size, p.size);
        p.a = (float)shape->box.rounding;
        break;
    case SHAPE_TORUS:
        p.a = (float)shape->torus.major_radius;
        p.b = (float)shape->torus.minor_radius;
        break;
    case SHAPE_CONE: {
        double across = shape->cone.top_radius - shape->cone.bottom_radius;
        double up = 2.0 * shape->cone.half_height;
        p.a = (float)shape->cone.bottom_radius;
        p.b = (float)shape->cone.top_radius;
        p.c = (float)shape->cone.half_height;
        p.slope[0] = (float)across;
        p.slope[1] = (float)up;
        p.per_slope_sq = (float)(1.0 / (across * across + up * up));
        break;
    }
    case SHAPE_OCTAHEDRON: p.a = (float)shape->octahedron.radius; break;
    case SHAPE_PLANE:
        to_floats(shape->plane.normal, p.size);
        p.a = (float)shape->plane.offset;
        break;
    default:
        p.bailout = (float)shape->mandelbulb.bailout;
        p.iterations = shape->mandelbulb.iterations;
        break;
    }
    return p;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    for (int i = 0; i < model->shape_count; i++)
        prepared->placed[i] = place_shape(i, &model->shapes[i], &model->march);
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

static struct vec vec_from(const double a[3]) {
    return (struct vec){set((float)a[0]), set((float)a[1]), set((float)a[2])};
}

static struct place place_of(const double a[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(a[i], &hi[i], &lo[i]);
    return (struct place){vec_set(hi), vec_set(lo)};
}

static struct vec get_direction(int column, int row, const struct frame *frame,
                                const struct view *view) {
    COUNT(get_direction, call);
    COUNT(get_direction, scalar);
    double per_height = view->tan_half_fov / frame->height;
    float first = (float)(2.0 * column + 1.0 - frame->width); // a whole number: exact
    real columns = set(first) + _mm256_setr_ps(0, 2, 4, 6, 8, 10, 12, 14);
    real x = columns * set((float)per_height);
    real y = set((float)((frame->height - 1.0 - 2.0 * row) * per_height));
    struct vec d = vec_along(vec_from(view->forward), vec_from(view->right), x);
    d = vec_along(d, vec_from(view->up), y);
    return vec_scale(d, set(1.0f) / vec_norm(d));
}

static void store_plane(float *plane, int stride, int count, real values) {
    float lanes[LANES];
    _mm256_storeu_ps(lanes, values);
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
    const struct hit *hit = &seen->hit;
    float *normal = frame->normal + 3 * pixel;
    store_plane(frame->depth + pixel, 1, count, choose(hit->found, hit->t, set(INFINITY)));
    store_plane(frame->id + pixel, 1, count, hit->shape);
    store_plane(normal, 3, count, hit->normal.x);
    store_plane(normal + 1, 3, count, hit->normal.y);
    store_plane(normal + 2, 3, count, hit->normal.z);
    store_plane(frame->evals + pixel, 1, count, hit->evals);
}

// Lanes below `count`.
static mask first_lanes(int count) {
    return less(_mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7), set((float)count));
}

static struct approach *new_approaches(const struct prepared *prepared) {
    return aligned_alloc(32, (size_t)prepared->model.shape_count * sizeof(struct approach));
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    COUNT(phase_render, call);
    struct world world = {prepared, view, new_approaches(prepared)};
    if (!world.approach)
        return false;
    struct place origin = place_of(view->position);
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
    free(world.approach);
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    struct approach *approach = new_approaches(prepared);
    if (!approach)
        return false;
    struct vec nowhere = {set(0.0f), set(0.0f), set(0.0f)};
    for (size_t i = 0; i < count; i++) {
        real shape = set(-1.0f);
        approach_origins(place_of(points + 3 * i), prepared, approach);
        approach_directions(nowhere, prepared, approach);
        distance[i] = _mm256_cvtss_f32(sdf(approach, set(0.0f), prepared, set(0.0f), &shape));
        nearest[i] = (int)_mm256_cvtss_f32(shape);
    }
    free(approach);
    return true;
}
