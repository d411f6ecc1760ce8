// The phase's entry points (common/phase.h) and its loop over pixels: eight neighbours of a row at a
// time, one ray through the centre of each. A mask cuts the last packet of a row to the width.
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

static void to_floats(const double from[3], float to[3]) {
    for (int i = 0; i < 3; i++)
        to[i] = (float)from[i];
}

// Fills what moves a ray's origin into the shape's frame. A LINEAR plane needs one row only.
static void set_local_frame(struct primitive *p, const struct shape *shape, double rotation[3][3]) {
    bool linear = p->eval == LINEAR;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double *n = shape->plane.normal;
            p->row[i][j] =
                linear ? n[0] * rotation[0][j] + n[1] * rotation[1][j] + n[2] * rotation[2][j]
                       : rotation[i][j];
        }
        p->centre[i] = shape->position[i];
    }
    if (p->eval == POWER) {
        p->radius_sq = shape->sphere.radius * shape->sphere.radius;
        p->sphere.radius_sq = (float)p->radius_sq;
    }
    if (linear) {
        p->offset = shape->plane.offset;
        to_floats(p->row[0], p->normal);
    }
}

// How to evaluate a shape. A sphere wider than the bounds is always nearer than its radius: there its
// power is as exact as a point, and much more exact near the surface. For other spheres a point is
// cheaper, and more exact many radii away. The square of 1e15 still fits a float.
static enum eval_kind eval_kind_of(const struct shape *shape, bool repeated,
                                   const struct limits *limits) {
    if (repeated)
        return AT_POINT;
    if (shape->type == SHAPE_SPHERE && shape->sphere.radius >= limits->bounds_radius &&
        shape->sphere.radius < 1e15)
        return POWER;
    return shape->type == SHAPE_PLANE ? LINEAR : AT_POINT;
}

static void set_mandelbox(const struct shape *shape, struct primitive *p) {
    p->mandelbox.scale = (float)shape->mandelbox.scale;
    p->mandelbox.stretch = (float)fabs(shape->mandelbox.scale);
    p->mandelbox.fold_limit = (float)shape->mandelbox.fold_limit;
    p->mandelbox.inner_sq =
        (float)(shape->mandelbox.minimum_radius * shape->mandelbox.minimum_radius);
    p->mandelbox.outer_sq = (float)(shape->mandelbox.fixed_radius * shape->mandelbox.fixed_radius);
    p->mandelbox.iterations = shape->mandelbox.iterations;
}

static struct primitive make_primitive(int index, const struct shape *shape,
                                       const struct limits *limits) {
    struct primitive p = {.type = shape->type, .index = (float)index};
    double rotation[3][3];
    rotation_matrix(shape->rotation_degrees, rotation);
    for (int i = 0; i < 3; i++) {
        split(shape->position[i], &p.position[i], &p.position_lo[i]);
        to_floats(rotation[i], p.rotation[i]);
        p.rotated = p.rotated || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = (float)shape->repeat[i];
        p.cell_double[i] = shape->repeat[i];
        p.inv_cell_double[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
        p.inv_cell[i] = (float)p.inv_cell_double[i];
    }
    p.eval = eval_kind_of(shape, p.repeated, limits);
    set_local_frame(&p, shape, rotation);
    switch (shape->type) {
    case SHAPE_SPHERE: p.sphere.radius = (float)shape->sphere.radius; break;
    case SHAPE_BOX: to_floats(shape->box.half_size, p.box.half_size); break;
    case SHAPE_ROUNDED_BOX:
        to_floats(shape->box.half_size, p.box.half_size);
        p.box.rounding = (float)shape->box.rounding;
        break;
    case SHAPE_TORUS:
        p.torus.major_radius = (float)shape->torus.major_radius;
        p.torus.minor_radius = (float)shape->torus.minor_radius;
        break;
    case SHAPE_CONE: {
        double across = shape->cone.top_radius - shape->cone.bottom_radius;
        double up = 2.0 * shape->cone.half_height;
        p.cone.bottom_radius = (float)shape->cone.bottom_radius;
        p.cone.top_radius = (float)shape->cone.top_radius;
        p.cone.half_height = (float)shape->cone.half_height;
        p.cone.side[0] = (float)across;
        p.cone.side[1] = (float)up;
        p.cone.inv_side_sq = (float)(1.0 / (across * across + up * up));
        break;
    }
    case SHAPE_OCTAHEDRON: p.octahedron.radius = (float)shape->octahedron.radius; break;
    case SHAPE_PLANE:
        to_floats(shape->plane.normal, p.plane.normal);
        p.plane.offset = (float)shape->plane.offset;
        break;
    case SHAPE_MANDELBOX: set_mandelbox(shape, &p); break;
    default:
        p.mandelbulb.bailout = (float)shape->mandelbulb.bailout;
        p.mandelbulb.iterations = shape->mandelbulb.iterations;
        break;
    }
    return p;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    for (int i = 0; i < model->shape_count; i++)
        prepared->primitives[i] = make_primitive(i, &model->shapes[i], &model->march);
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

static struct vec vec_from_doubles(const double a[3]) {
    return (struct vec){v_splat((float)a[0]), v_splat((float)a[1]), v_splat((float)a[2])};
}

// A point of the world as sums of two floats, the same in all lanes.
static struct point point_from_doubles(const double a[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(a[i], &hi[i], &lo[i]);
    return (struct point){vec_set(hi), vec_set(lo)};
}

// Unit directions of the rays through the centres of eight pixels of a row.
static struct vec get_direction(int column, int row, const struct frame *frame,
                                const struct view *view) {
    COUNT(get_direction, call);
    COUNT(get_direction, scalar);
    double pixel_size = view->tan_half_fov / frame->height;
    float first = (float)(2.0 * column + 1.0 - frame->width); // an integer, so it is exact
    vfloat columns = v_splat(first) + _mm256_setr_ps(0, 2, 4, 6, 8, 10, 12, 14);
    vfloat x = columns * v_splat((float)pixel_size);
    vfloat y = v_splat((float)((frame->height - 1.0 - 2.0 * row) * pixel_size));
    struct vec d = vec_along(vec_from_doubles(view->forward), vec_from_doubles(view->right), x);
    d = vec_along(d, vec_from_doubles(view->up), y);
    return vec_scale(d, v_splat(1.0f) / vec_norm(d));
}

// Writes the first `count` lanes, one every `stride` floats.
static void store_plane(float *plane, int stride, int count, vfloat values) {
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
    store_plane(frame->depth + pixel, 1, count, v_select(hit->found, hit->t, v_splat(INFINITY)));
    store_plane(frame->id + pixel, 1, count, hit->shape);
    store_plane(normal, 3, count, hit->normal.x);
    store_plane(normal + 1, 3, count, hit->normal.y);
    store_plane(normal + 2, 3, count, hit->normal.z);
    store_plane(frame->evals + pixel, 1, count, hit->evals);
}

// The first `count` lanes.
static vmask v_mask_first(int count) {
    return v_cmp_lt(_mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7), v_splat((float)count));
}

static struct local_ray *new_local_rays(const struct prepared *prepared) {
    return aligned_alloc(32, (size_t)prepared->model.shape_count * sizeof(struct local_ray));
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    COUNT(phase_render, call);
    struct world world = {prepared, view, new_local_rays(prepared)};
    if (!world.local_rays)
        return false;
    struct point origin = point_from_doubles(view->position);
    for (int row = 0; row < frame->height; row++) {
        for (int column = 0; column < frame->width; column += LANES) {
            int count = frame->width - column < LANES ? frame->width - column : LANES;
            ACTIVE(count);
            COUNT(phase_render, packet);
            struct shaded seen;
            trace(origin, get_direction(column, row, frame, view), v_mask_first(count), 0, &world,
                  &seen);
            ACTIVE(count);
            store(frame, (size_t)row * (size_t)frame->width + (size_t)column, count, &seen);
        }
    }
    free(world.local_rays);
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    struct local_ray *rays = new_local_rays(prepared);
    if (!rays)
        return false;
    struct vec nowhere = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (size_t i = 0; i < count; i++) {
        vfloat shape = v_splat(-1.0f);
        local_ray_origins(point_from_doubles(points + 3 * i), prepared, rays);
        local_ray_directions(nowhere, prepared, rays);
        distance[i] = _mm256_cvtss_f32(sdf(rays, v_splat(0.0f), prepared, v_mask_none(), &shape));
        nearest[i] = (int)_mm256_cvtss_f32(shape);
    }
    free(rays);
    return true;
}
