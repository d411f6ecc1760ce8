// The phase's entry points, and the choice between the kernels for 8 and for 16 lanes: the same sources
// (tile.c, rods.c, march.c, shade.c), built twice.
#include <math.h>
#include <stdalign.h>
#include <stdlib.h>
#include <string.h>

#include "placed.h"
#include "variant.h"
#include "workers/workers.h"

// What the march reads is `prepared`, as in opt4; the team stands behind it.
struct kept {
    struct prepared prepared;
    struct workers *workers;
    bool sixteen; // lanes, not eight
};

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

// From a shape's centre to its furthest point; of a plane, which is nowhere near, nothing.
static float reach_of(const struct shape *shape) {
    const double *half = shape->box.half_size;
    switch (shape->type) {
    case SHAPE_SPHERE: return (float)shape->sphere.radius;
    case SHAPE_BOX: return (float)hypot(hypot(half[0], half[1]), half[2]);
    case SHAPE_ROUNDED_BOX:
        return (float)(hypot(hypot(half[0], half[1]), half[2]) + shape->box.rounding);
    case SHAPE_TORUS: return (float)(shape->torus.major_radius + shape->torus.minor_radius);
    case SHAPE_CONE:
        return (float)hypot(fmax(shape->cone.bottom_radius, shape->cone.top_radius),
                            shape->cone.half_height);
    case SHAPE_OCTAHEDRON: return (float)shape->octahedron.radius;
    default: return 0.0f;
    }
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
    p.steady = !p.repeated && p.type != SHAPE_MANDELBULB;
    p.slack = 0x1p-18f * reach_of(shape);
    return p;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    int next = 0;
    prepared->steady_count = 0;
    for (int i = 0; i < model->shape_count; i++)
        prepared->placed[i] = place_shape(i, &model->shapes[i], &model->march);
    for (int steady = 1; steady >= 0; steady--)
        for (int type = 0; type < SHAPE_TYPES; type++)
            for (int i = 0; i < model->shape_count; i++)
                if (prepared->placed[i].steady == steady && (int)prepared->placed[i].type == type) {
                    prepared->order[next++] = i;
                    prepared->steady_count += steady;
                }
    return true;
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct kept *kept = calloc(1, sizeof *kept);
    struct placed *placed = calloc((size_t)model->shape_count, sizeof *placed);
    int *order = calloc((size_t)model->shape_count, sizeof *order);
    if (kept && placed && order) {
        kept->sixteen = variant_here().lanes == 16;
        kept->workers = workers_start(threads, kept->sixteen ? lanes16_own_size(model)
                                                             : lanes8_own_size(model));
    }
    if (!kept || !placed || !order || !kept->workers) {
        free(kept);
        free(placed);
        free(order);
        return NULL;
    }
    kept->prepared.placed = placed;
    kept->prepared.order = order;
    char error[512];
    settings_read(getenv("STEPWISE_RODS"), &kept->prepared.settings, error);
    settings_say(&kept->prepared.settings, kept->prepared.said);
    phase_update(&kept->prepared, model);
    return &kept->prepared;
}

void phase_release(struct prepared *prepared) {
    struct kept *kept = (struct kept *)prepared; // its first member
    workers_end(kept->workers);
    free(prepared->placed);
    free(prepared->order);
    free(kept);
}

// Apart from what the caller writes on its stack: all workers read it.
struct frame_job {
    alignas(WORKERS_APART) struct job job;
    bool sixteen;
};

static void render_tile(const void *data, int tile, void *own) {
    const struct frame_job *job = data;
    if (job->sixteen)
        lanes16_tile(&job->job, tile, own);
    else
        lanes8_tile(&job->job, tile, own);
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    const struct kept *kept = (const struct kept *)prepared; // its first member
    struct frame_job job = {{prepared, view, frame}, kept->sixteen};
    workers_run(kept->workers, render_tile, &job,
                kept->sixteen ? lanes16_tiles(frame) : lanes8_tiles(frame));
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    const struct kept *kept = (const struct kept *)prepared; // its first member
    return kept->sixteen ? lanes16_distances(prepared, count, points, distance, nearest)
                         : lanes8_distances(prepared, count, points, distance, nearest);
}
