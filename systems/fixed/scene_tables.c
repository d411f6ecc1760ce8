// Converts a scene to the phase's numbers, and finds the blocks of pixels that may see each sphere.
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
#include "scene_tables.h"

#include <math.h>
#include <stdlib.h>

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

bool tables_create(struct scene_tables *scene, int count) {
    scalar **numbers[] = {
        &scene->centre[0], &scene->centre[1], &scene->centre[2], &scene->radius_sq,
        &scene->eye[0],    &scene->eye[1],    &scene->eye[2],    &scene->minus_c,
        &scene->colour[0], &scene->colour[1], &scene->colour[2], &scene->mirror_weight,
        &scene->shininess,
    };
    enum { NUMBERS = sizeof numbers / sizeof *numbers, BOUNDS = 4 };
    scalar *table = calloc((size_t)count * NUMBERS, sizeof *table);
    int *blocks = calloc((size_t)count * BOUNDS, sizeof *blocks);
    if (!table || !blocks) {
        free(table);
        free(blocks);
        return false;
    }
    for (int i = 0; i < NUMBERS; i++)
        *numbers[i] = table + (size_t)i * (size_t)count;
    for (int i = 0; i < BOUNDS; i++)
        scene->blocks[i] = blocks + (size_t)i * (size_t)count;
    scene->count = count;
    return true;
}

void tables_free(struct scene_tables *scene) {
    free(scene->centre[0]);
    free(scene->blocks[0]);
}

void tables_set_shapes(struct scene_tables *scene, const struct model *model) {
    const struct format *f = &scene->format;
    scene->shadows = model->shadows != SHADOWS_NONE;
    scene->mirrors = model->features.mirrors;
    scene->bounces = scene->mirrors ? model->march.max_bounces : 0;
    scene->surface_offset = scalar_from_length(model->march.surface_offset, f);
    scene->ambient = scalar_from(0.01, f);
    scene->specular = scalar_from(0.2, f);
    scene->one = scalar_from(1, f);
    scene->shininess_bits = 0;
    const double unit = ldexp(1, f->unit);
    for (int i = 0; i < scene->count; i++) {
        const struct shape *shape = &model->shapes[i];
        const struct material *m = &model->materials[shape->material];
        for (int k = 0; k < 3; k++) {
            scene->centre[k][i] = scalar_from_length(shape->position[k], f);
            scene->colour[k][i] = scalar_from(m->color[k], f);
        }
        scene->radius_sq[i] =
            scalar_from(shape->sphere.radius * shape->sphere.radius / (unit * unit), f);
        scene->mirror_weight[i] = scalar_from(0.1 * m->reflectivity, f);
        scene->shininess[i] = (scalar)m->shininess;
        while (m->shininess >= ldexp(1, scene->shininess_bits))
            scene->shininess_bits++;
    }
    for (int k = 0; k < 3; k++) {
        scene->background[k] = scalar_from(model->background[k], f);
        scene->exact_background[k] = (float)model->background[k];
    }
}

// The first and the last band of blocks that may see a sphere, along one axis of the picture; first > last: none.
// A band lies between two planes through the camera: the sphere must not be wholly outside of either.
// across, ahead: the sphere's centre in the camera's frame. half: half of a pixel's side, one unit ahead.
static void block_range(double across, double ahead, double radius, double half, int size,
                        int *first, int *last) {
    *first = (size + BLOCK - 1) / BLOCK;
    *last = -1;
    if (!(ahead > -radius))
        return;
    for (int band = 0; band * BLOCK < size; band++) {
        double begin = (2.0 * BLOCK * band - size) * half, end = begin + 2 * BLOCK * half;
        if (across - begin * ahead >= -radius * sqrt(1 + begin * begin) &&
            across - end * ahead <= radius * sqrt(1 + end * end)) {
            *first = band < *first ? band : *first;
            *last = band;
        }
    }
}

// The radius is enlarged by the error of the discriminant: b² is off by twice the direction's error, the other terms
// by a few last bits. So no block is missed that sees the sphere as the numbers place it.
static void sphere_block_range(struct scene_tables *scene, int i, const struct shape *shape,
                               const struct view *view, const struct frame *frame) {
    const struct format *f = &scene->format;
    double from[3], half = view->tan_half_fov / frame->height;
    for (int k = 0; k < 3; k++)
        from[k] = in_units(shape->position[k] - view->position[k], f);
    double far_sq = dot(from, from), radius = in_units(shape->sphere.radius, f);
    radius = sqrt(radius * radius + 2 * direction_error(f) * (far_sq + sqrt(far_sq) + 1));
    double ahead = dot(from, view->forward);
    block_range(dot(from, view->right), ahead, radius, half, frame->width, &scene->blocks[0][i],
                &scene->blocks[1][i]);
    block_range(-dot(from, view->up), ahead, radius, half, frame->height, &scene->blocks[2][i],
                &scene->blocks[3][i]);
}

void tables_set_view(struct scene_tables *scene, const struct model *model, const struct view *view,
                     const struct frame *frame) {
    const struct format *f = &scene->format;
    set_camera_basis(scene, view, frame);
    for (int k = 0; k < 3; k++) {
        scene->position[k] = scalar_from_length(view->position[k], f);
        scene->light[k] = scalar_from_length(view->light_position[k], f);
        scene->emission[k] = scalar_from_per_length(view->light_emission[k], f);
    }
    for (int i = 0; i < scene->count; i++) {
        const struct shape *shape = &model->shapes[i];
        double eye[3];
        for (int k = 0; k < 3; k++) {
            eye[k] = in_units(view->position[k] - shape->position[k], f);
            scene->eye[k][i] = scalar_from(eye[k], f);
        }
        double radius = in_units(shape->sphere.radius, f);
        scene->minus_c[i] = scalar_from(radius * radius - dot(eye, eye), f);
        if (f->clear == CLEAR_SAFE || f->clear == CLEAR_LISTS)
            sphere_block_range(scene, i, shape, view, frame);
    }
}
