// The phase's entry points (common/phase.h) and its loop over pixels: four neighbours of a row at a
// time, one ray through the centre of each. A mask cuts the last packet of a row to the width.
#include "phase.h"
#include "scene/vector.h"
#include "trace.h"

#include "scene/prepare_once.h" // needs trace.h

#include "scene/shape_sizes.h" // needs trace.h

static struct primitive make_primitive(int index, const struct shape *shape) {
    struct primitive p = {.type = shape->type, .index = index};
    memcpy(p.position, shape->position, sizeof p.position);
    rotation_matrix(shape->rotation_degrees, p.rotation);
    for (int i = 0; i < 3; i++) {
        p.rotated = p.rotated || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = shape->repeat[i];
        p.inv_cell[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
    }
    set_sizes(shape, &p);
    return p;
}

#define PRIMITIVE_OF(shape) make_primitive(0, shape)
#include "scene/group_compile.h"

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    prepared->bounds_sq = model->march.bounds_radius * model->march.bounds_radius;
    struct instruction *next = prepared->instructions;
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        prepared->primitives[i] = make_primitive(i, shape);
        if (shape->type == SHAPE_GROUP)
            next = group_compile(model, shape->group.root, &prepared->primitives[i], next);
    }
    return true;
}

// Unit directions of the rays through the centres of four pixels of a row.
static struct vec get_direction(int column, int row, const struct frame *frame,
                                const struct view *view) {
    COUNT(get_direction, call);
    COUNT(get_direction, scalar);
    double pixel_size = view->tan_half_fov / frame->height;
    vdouble columns = _mm256_setr_pd(column, column + 1, column + 2, column + 3);
    vdouble x = v_madd(v_splat(2.0), columns, v_splat(1.0 - frame->width)) * v_splat(pixel_size);
    vdouble y = v_splat((frame->height - 1.0 - 2.0 * row) * pixel_size);
    struct vec d = vec_along(vec_set(view->forward), vec_set(view->right), x);
    d = vec_along(d, vec_set(view->up), y);
    return vec_scale(d, v_splat(1.0) / vec_norm(d));
}

// Writes the first `count` lanes, one every `stride` floats.
static void store_plane(float *plane, int stride, int count, vdouble values) {
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
                v_select(seen->hit.found, seen->hit.t, v_splat(INFINITY)));
    store_plane(frame->id + pixel, 1, count, seen->hit.shape);
    store_plane(normal, 3, count, seen->normal.x);
    store_plane(normal + 1, 3, count, seen->normal.y);
    store_plane(normal + 2, 3, count, seen->normal.z);
    store_plane(frame->evals + pixel, 1, count, seen->hit.evals);
}

// The first `count` lanes.
static vmask v_mask_first(int count) {
    return v_cmp_lt(_mm256_setr_pd(0, 1, 2, 3), v_splat(count));
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
            trace(origin, get_direction(column, row, frame, view), v_mask_first(count), 0, &world,
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
        vdouble shape = v_splat(-1.0);
        vdouble h = sdf(vec_set(points + 3 * i), prepared, v_mask_none(),
                        prepared->model.features.groups, &shape);
        distance[i] = _mm256_cvtsd_f64(h);
        nearest[i] = (int)_mm256_cvtsd_f64(shape);
    }
    return true;
}
