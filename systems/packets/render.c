// The phase's entry points, and the choice between the kernels for 4, 8 and 16 lanes, which are
// built from the same sources ("each_variant" of phase.json).
#include <math.h>
#include <stdalign.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "driver/variant.h"
#include "scene/vector.h"
#include "trace.h"

// The phase's state behind `prepared`, which is all that the kernels read.
struct phase_state {
    struct prepared prepared;
    struct workers *workers;
    int lanes;
    const struct lane_kernel *kernel; // for so many
    struct bounded_solid *solids;     // room for one per shape
};

static const char *unsupported_shape(const struct scene *scene, char *error, size_t size) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct shape *s = &scene->model.shapes[i];
        if (s->type != SHAPE_SPHERE && s->type != SHAPE_PLANE && s->type != SHAPE_BOX &&
            s->type != SHAPE_CONE)
            snprintf(
                error, size,
                "shapes[%d] is of type \"%s\": packets has closed forms of spheres, planes, boxes "
                "and capped cones alone",
                i, shape_type_name(s->type));
        else if (s->repeat[0] > 0 || s->repeat[1] > 0 || s->repeat[2] > 0)
            snprintf(error, size,
                     "shapes[%d] is repeated without end, and a tree holds only so many shapes: "
                     "packets renders scenes without \"repeat\"",
                     i);
        else
            continue;
        return error;
    }
    return NULL;
}

const char *phase_unsupported(const struct scene *scene) {
    static char error[512];
    struct settings settings;
    const double *p = scene->view.position, bounds = scene->model.march.bounds_radius;
    if (!settings_read(getenv("STEPWISE_PACKETS"), &settings, error))
        return error;
    if (scene->model.shadows == SHADOWS_SOFT || scene->model.shadows == SHADOWS_IDEAL)
        return "soft shadows come from distances along the ray, and closed forms have none: "
               "packets renders shadows \"hard\" or \"none\"";
    if (!(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] < bounds * bounds))
        return "the camera is outside of march.bounds_radius, where a march ends at once: packets "
               "needs it inside";
    return unsupported_shape(scene, error, sizeof error);
}

const char *phase_settings(const struct prepared *prepared) {
    return prepared->settings_text;
}

static struct primitive prepare_primitive(const struct shape *shape,
                                          const struct material *material) {
    struct primitive p = {.type = shape->type};
    double turn[3][3];
    rotation_matrix(shape->rotation_degrees, turn);
    for (int i = 0; i < 3; i++) {
        p.position[i] = (float)shape->position[i];
        p.turned = p.turned || shape->rotation_degrees[i] != 0.0;
        p.color[i] = (float)material->color[i];
        for (int j = 0; j < 3; j++)
            p.turn[i][j] = (float)turn[i][j];
    }
    p.share = (float)(0.1 * material->reflectivity);
    p.shininess = (float)material->shininess;
    if (shape->type == SHAPE_SPHERE)
        p.size[0] = (float)shape->sphere.radius;
    if (shape->type == SHAPE_BOX)
        for (int i = 0; i < 3; i++)
            p.size[i] = (float)shape->box.half_size[i];
    if (shape->type == SHAPE_CONE) { // half height; radius = slope·y + radius at the middle
        double k =
            (shape->cone.top_radius - shape->cone.bottom_radius) / (2 * shape->cone.half_height);
        p.size[0] = (float)shape->cone.half_height;
        p.size[1] = (float)k;
        p.size[2] = (float)(0.5 * (shape->cone.top_radius + shape->cone.bottom_radius));
        p.cosine = (float)(1 / sqrt(1 + k * k));
    }
    if (shape->type == SHAPE_PLANE) {
        double offset = shape->plane.offset;
        for (int j = 0; j < 3; j++) {
            double n = 0;
            for (int i = 0; i < 3; i++)
                n += shape->plane.normal[i] * turn[i][j];
            p.normal[j] = (float)n;
            offset += n * shape->position[j];
        }
        p.offset = (float)offset;
    }
    return p;
}

// Returns half of the size of a solid's bounding box along an axis of the world.
static double half_extent(const struct shape *shape, const struct primitive *p, int axis) {
    const double *half = shape->box.half_size;
    double up = fabs((double)p->turn[1][axis]);
    switch (shape->type) {
    case SHAPE_SPHERE: return shape->sphere.radius;
    case SHAPE_BOX:
        return half[0] * fabs((double)p->turn[0][axis]) + half[1] * up +
               half[2] * fabs((double)p->turn[2][axis]);
    default: // of a cylinder around the cone
        return shape->cone.half_height * up +
               fmax(shape->cone.bottom_radius, shape->cone.top_radius) * sqrt(fmax(1 - up * up, 0));
    }
}

static struct bounded_solid bounded_solid_of(int index, const struct shape *shape,
                                             const struct primitive *p) {
    struct bounded_solid s = {.type = shape->type == SHAPE_SPHERE ? SOLID_SPHERE
                                      : shape->type == SHAPE_BOX  ? SOLID_BOX
                                                                  : SOLID_CONE,
                              .index = index};
    for (int k = 0; k < 3; k++) {
        double reach = half_extent(shape, p, k) * (1 + 1e-6) + 1e-7 * fabs(shape->position[k]);
        s.box.lo[k] = (float)(shape->position[k] - reach);
        s.box.hi[k] = (float)(shape->position[k] + reach);
        s.field[F_CENTRE + k] = p->position[k];
    }
    if (s.type == SOLID_SPHERE) {
        s.field[F_SQUARE] = (float)(shape->sphere.radius * shape->sphere.radius);
        return s;
    }
    memcpy(&s.field[F_ROW], p->turn, sizeof p->turn);
    memcpy(&s.field[F_SIZE], p->size, sizeof p->size);
    return s;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    struct phase_state *state = (struct phase_state *)prepared; // its first member
    int solids = 0;
    prepared->model = *model;
    prepared->plane_count = 0;
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        prepared->primitives[i] = prepare_primitive(shape, &model->materials[shape->material]);
        if (shape->type == SHAPE_PLANE)
            prepared->planes[prepared->plane_count++] = i;
        else if (shape->type == SHAPE_SPHERE || shape->type == SHAPE_BOX ||
                 shape->type == SHAPE_CONE)
            state->solids[solids++] = bounded_solid_of(i, shape, &prepared->primitives[i]);
    }
    return tree_build(&prepared->tree, prepared->settings.tree, state->lanes, state->solids,
                      solids);
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct phase_state *state = calloc(1, sizeof *state);
    if (!state)
        return NULL;
    struct prepared *prepared = &state->prepared;
    size_t count = (size_t)model->shape_count;
    char error[512];
    state->lanes = variant_here().lanes;
    state->kernel = state->lanes == 16  ? &lanes16_kernel
                    : state->lanes == 8 ? &lanes8_kernel
                                        : &lanes4_kernel;
    settings_read(getenv("STEPWISE_PACKETS"), &prepared->settings, error);
    settings_print(&prepared->settings, prepared->settings_text);
    prepared->primitives = calloc(count, sizeof *prepared->primitives);
    prepared->planes = calloc(count, sizeof *prepared->planes);
    state->solids = calloc(count, sizeof *state->solids);
    if (prepared->primitives && prepared->planes && state->solids && phase_update(prepared, model))
        state->workers = workers_start(threads, state->kernel->scratch_size);
    if (state->workers)
        return prepared;
    phase_release(prepared);
    return NULL;
}

void phase_release(struct prepared *prepared) {
    struct phase_state *state = (struct phase_state *)prepared; // its first member
    workers_end(state->workers);
    tree_free(&prepared->tree);
    free(prepared->primitives);
    free(prepared->planes);
    free(state->solids);
    free(state);
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    const struct phase_state *state = (const struct phase_state *)prepared; // its first member
    // All workers read it.
    alignas(WORKERS_APART) struct job job = {prepared, view, frame};
    workers_run(state->workers, state->kernel->tile, &job, state->kernel->tiles(frame));
    return true;
}

bool phase_hits(const struct prepared *prepared, const struct ray_set *rays) {
    const struct phase_state *state = (const struct phase_state *)prepared; // its first member
    const size_t most = BATCH;
    for (size_t first = 0; first < rays->count; first += most) {
        size_t count = rays->count - first < most ? rays->count - first : most;
        state->kernel->hits(prepared, rays, first, count);
    }
    return true;
}

static double distance_to(const struct shape *shape, const double *point) {
    double turn[3][3], p[3], q[3], m[3];
    rotation_matrix(shape->rotation_degrees, turn);
    for (int i = 0; i < 3; i++)
        m[i] = point[i] - shape->position[i];
    for (int i = 0; i < 3; i++)
        p[i] = turn[i][0] * m[0] + turn[i][1] * m[1] + turn[i][2] * m[2];
    switch (shape->type) {
    case SHAPE_SPHERE: return sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]) - shape->sphere.radius;
    case SHAPE_PLANE: {
        const double *n = shape->plane.normal;
        return n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - shape->plane.offset;
    }
    case SHAPE_BOX: {
        double square = 0;
        for (int i = 0; i < 3; i++) {
            q[i] = fabs(p[i]) - shape->box.half_size[i];
            square += fmax(q[i], 0) * fmax(q[i], 0);
        }
        return sqrt(square) + fmin(fmax(q[0], fmax(q[1], q[2])), 0);
    }
    case SHAPE_CONE: { // in the plane of its axis: to the cap, to the side from rim to rim
        double h = shape->cone.half_height, low = shape->cone.bottom_radius;
        double across = shape->cone.top_radius - low, up = 2 * h, radius = hypot(p[0], p[2]);
        double rim = p[1] < 0 ? low : shape->cone.top_radius;
        double cap = hypot(fmax(radius - rim, 0), fabs(p[1]) - h);
        double along = ((radius - low) * across + (p[1] + h) * up) / (across * across + up * up);
        along = fmin(fmax(along, 0), 1);
        double side = hypot(radius - low - along * across, p[1] + h - along * up);
        bool inside = fabs(p[1]) < h && radius < low + across * (p[1] + h) / up;
        return (inside ? -1 : 1) * fmin(cap, side);
    }
    default: return INFINITY;
    }
}

// In double precision: for tests, no ray uses it.
bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    for (size_t i = 0; i < count; i++) {
        distance[i] = INFINITY;
        nearest[i] = 0;
        for (int k = 0; k < prepared->model.shape_count; k++) {
            double d = distance_to(&prepared->model.shapes[k], points + 3 * i);
            if (d < distance[i]) {
                distance[i] = d;
                nearest[i] = k;
            }
        }
    }
    return true;
}
