// The phase's entry points (common/phase.h) and its loop over pixels: one ray through the centre of
// each.
#include <stdlib.h>
#include <string.h>

#include "phase.h"
#include "trace.h"

const char *phase_unsupported(const struct scene *scene) {
    (void)scene;
    return NULL;
}

// The rotations about x, then y, then z as one matrix. Each takes (u, v) to (c·u − s·v, s·u + c·v),
// on (y,z), then (x,z), then (x,y).
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
    case SHAPE_TORUS:
        p.torus.major_radius = shape->torus.major_radius;
        p.torus.minor_radius = shape->torus.minor_radius;
        break;
    case SHAPE_ROUNDED_BOX:
        memcpy(p.box.half_size, shape->box.half_size, sizeof shape->box.half_size);
        p.box.rounding = shape->box.rounding;
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
    phase_update(prepared, model);
    return prepared;
}

void phase_release(struct prepared *prepared) {
    free(prepared->primitives);
    free(prepared);
}

// The unit direction of the ray through the pixel's centre.
static void get_direction(int column, int row, const struct frame *frame, const struct view *view,
                          double *direction) {
    COUNT(get_direction, call);
    double pixel_size = view->tan_half_fov / frame->height;
    double x = (2.0 * column + 1.0 - frame->width) * pixel_size;
    double y = (frame->height - 1.0 - 2.0 * row) * pixel_size;
    for (int i = 0; i < 3; i++)
        direction[i] = view->forward[i] + view->right[i] * x + view->up[i] * y;
    vec_scale(direction, 1.0 / vec_norm(direction), direction);
}

static void store(struct frame *frame, size_t pixel, const struct shaded *seen) {
    frame->rgb[3 * pixel] = (float)seen->color[0];
    frame->rgb[3 * pixel + 1] = (float)seen->color[1];
    frame->rgb[3 * pixel + 2] = (float)seen->color[2];
    if (!frame->depth)
        return;
    frame->depth[pixel] = seen->hit.found ? (float)seen->hit.t : INFINITY;
    frame->id[pixel] = (float)seen->hit.shape;
    frame->normal[3 * pixel] = (float)seen->normal[0];
    frame->normal[3 * pixel + 1] = (float)seen->normal[1];
    frame->normal[3 * pixel + 2] = (float)seen->normal[2];
    frame->evals[pixel] = (float)seen->hit.evals;
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    struct world world = {prepared, view};
    for (int row = 0; row < frame->height; row++) {
        for (int column = 0; column < frame->width; column++) {
            double direction[3];
            struct shaded seen;
            get_direction(column, row, frame, view, direction);
            trace(view->position, direction, 0, &world, &seen);
            store(frame, (size_t)row * (size_t)frame->width + (size_t)column, &seen);
        }
    }
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
