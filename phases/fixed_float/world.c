// The scene becomes numbers, in doubles as the article's own control code does it; and which blocks a sphere can be
// seen in.
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
#include "world.h"

#include <math.h>
#include <stdlib.h>

#include "counting/flops.h"

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

bool world_create(struct world *w, int count) {
    enum { TABLES = 13, RANGES = 4 };
    one *tables = calloc((size_t)count * TABLES, sizeof *tables);
    int *reach = calloc((size_t)count * RANGES, sizeof *reach);
    if (!tables || !reach) {
        free(tables);
        free(reach);
        return false;
    }
    one **all[TABLES] = {&w->centre[0], &w->centre[1], &w->centre[2], &w->radius_sq, &w->eye[0],
                         &w->eye[1],    &w->eye[2],    &w->rest,      &w->colour[0], &w->colour[1],
                         &w->colour[2], &w->mirror,    &w->shine};
    for (int i = 0; i < TABLES; i++)
        *all[i] = tables + (size_t)i * (size_t)count;
    for (int i = 0; i < RANGES; i++)
        w->reach[i] = reach + (size_t)i * (size_t)count;
    w->count = count;
    return true;
}

void world_free(struct world *w) {
    free(w->centre[0]);
    free(w->reach[0]);
}

void world_place(struct world *w, const struct model *model) {
    w->shadows = model->shadows != SHADOWS_NONE;
    w->mirrors = model->features.mirrors;
    w->bounces = w->mirrors ? model->march.max_bounces : 0;
    w->offset = (float)model->march.surface_offset;
    w->ambient = 0.01f;
    w->fifth = 0.2f;
    w->whole = 1;
    w->shine_bits = 0;
    for (int i = 0; i < w->count; i++) {
        const struct shape *shape = &model->shapes[i];
        const struct material *m = &model->materials[shape->material];
        for (int k = 0; k < 3; k++) {
            w->centre[k][i] = (float)shape->position[k];
            w->colour[k][i] = (float)m->color[k];
        }
        w->radius_sq[i] = (float)(shape->sphere.radius * shape->sphere.radius);
        w->mirror[i] = (float)(0.1 * m->reflectivity);
        w->shine[i] = (one)m->shininess;
        while (m->shininess >= ldexp(1, w->shine_bits))
            w->shine_bits++;
    }
    for (int k = 0; k < 3; k++) {
        w->background[k] = (float)model->background[k];
        w->exact_background[k] = (float)model->background[k];
    }
}

// How far a ray's direction, as it is rounded, may be from a unit vector or from where it should point; of the floats
// that a discriminant is the difference of, besides.
static const double DIRECTION_ERROR = 0x1p-20;

// First and last band, of those that begin and end `pitch` apart, in which a sphere can be seen: a plane through the
// camera and a band's edge against the sphere, along one axis of the picture. across, ahead: its centre in the
// camera's frame. The band of pixels i … i + 15 is from (2·i − size)·half to (2·i + 32 − size)·half.
static void reach_of(double across, double ahead, double radius, double half, int size, int *first,
                     int *last) {
    COUNT(reach_of, call);
    *first = (size + BLOCK - 1) / BLOCK;
    *last = -1;
    if (!(ahead > -radius))
        return;
    for (int band = 0; band * BLOCK < size; band++) {
        COUNT(reach_of, band);
        double begin = (2.0 * BLOCK * band - size) * half, end = begin + 2 * BLOCK * half;
        if (across - begin * ahead >= -radius * sqrt(1 + begin * begin) &&
            (COUNT(reach_of, before), across - end * ahead <= radius * sqrt(1 + end * end))) {
            *first = band < *first ? band : *first;
            *last = band;
        }
    }
}

static void reach_of_sphere(struct world *w, int i, const struct shape *shape,
                            const struct view *view, const struct frame *frame) {
    COUNT(reach_of_sphere, call);
    double from[3], half = view->tan_half_fov / frame->height;
    for (int k = 0; k < 3; k++)
        from[k] = shape->position[k] - view->position[k];
    double far_sq = dot(from, from), radius = shape->sphere.radius;
    // What rounding makes of it: b² is off by twice the direction's error, the rest by a few of the last bits.
    radius = sqrt(radius * radius + 2 * DIRECTION_ERROR * (far_sq + sqrt(far_sq) + 1));
    double ahead = dot(from, view->forward);
    reach_of(dot(from, view->right), ahead, radius, half, frame->width, &w->reach[0][i],
             &w->reach[1][i]);
    reach_of(-dot(from, view->up), ahead, radius, half, frame->height, &w->reach[2][i],
             &w->reach[3][i]);
}

static void aim(struct world *w, const struct view *view, const struct frame *frame) {
    w->per_height = (float)(view->tan_half_fov / frame->height);
    for (int k = 0; k < 3; k++) {
        w->forward[k] = (float)view->forward[k];
        w->right[k] = (float)view->right[k];
        w->up[k] = (float)view->up[k];
    }
}

void world_look(struct world *w, const struct model *model, const struct view *view,
                const struct frame *frame) {
    COUNT(world_look, call);
    const struct format *f = &w->format;
    aim(w, view, frame);
    for (int k = 0; k < 3; k++) {
        w->position[k] = (float)view->position[k];
        w->light[k] = (float)view->light_position[k];
        w->emission[k] = (float)view->light_emission[k];
    }
    for (int i = 0; i < w->count; i++) {
        COUNT(world_look, sphere);
        const struct shape *shape = &model->shapes[i];
        double from[3];
        for (int k = 0; k < 3; k++) {
            from[k] = view->position[k] - shape->position[k];
            w->eye[k][i] = (float)from[k];
        }
        double radius = shape->sphere.radius;
        w->rest[i] = (float)(radius * radius - dot(from, from));
        if (f->clear == CLEAR_SAFE || f->clear == CLEAR_LISTS)
            reach_of_sphere(w, i, shape, view, frame);
    }
}
