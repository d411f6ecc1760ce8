// The scene becomes numbers, in doubles as the article's own control code does it; and which blocks a sphere can be
// seen in.
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
#include "world.h"

#include <math.h>
#include <stdlib.h>

one one_of(double a, const struct format *f) {
    return llrint(a / f->scale);
}

one length_of(double a, const struct format *f) {
    return llrint(a / f->length);
}

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
    const struct format *f = &w->format;
    w->shadows = model->shadows != SHADOWS_NONE;
    w->mirrors = model->features.mirrors;
    w->bounces = w->mirrors ? model->march.max_bounces : 0;
    w->offset = length_of(model->march.surface_offset, f);
    w->ambient = one_of(0.01, f);
    w->fifth = one_of(0.2, f);
    w->whole = one_of(1, f);
    w->shine_bits = 0;
    const double unit = ldexp(1, f->unit);
    for (int i = 0; i < w->count; i++) {
        const struct shape *shape = &model->shapes[i];
        const struct material *m = &model->materials[shape->material];
        for (int k = 0; k < 3; k++) {
            w->centre[k][i] = length_of(shape->position[k], f);
            w->colour[k][i] = one_of(m->color[k], f);
        }
        w->radius_sq[i] = one_of(shape->sphere.radius * shape->sphere.radius / (unit * unit), f);
        w->mirror[i] = one_of(0.1 * m->reflectivity, f);
        w->shine[i] = (one)m->shininess;
        while (m->shininess >= ldexp(1, w->shine_bits))
            w->shine_bits++;
    }
    for (int k = 0; k < 3; k++) {
        w->background[k] = one_of(model->background[k], f);
        w->exact_background[k] = (float)model->background[k];
    }
}

// How far a ray's direction, as it is rounded, may be from a unit vector or from where it should point.
static double direction_error(const struct format *f) {
    static const double roots[] = {
        5e-6, 2e-3, 5e-6}; // relative, after so many Newton steps; the article's: two
    return ldexp(8, -f->bits) + (f->steps < 3 ? roots[f->steps] : 0);
}

// First and last band, of those that begin and end `pitch` apart, in which a sphere can be seen: a plane through the
// camera and a band's edge against the sphere, along one axis of the picture. across, ahead: its centre in the
// camera's frame. The band of pixels i … i + 15 is from (2·i − size)·half to (2·i + 32 − size)·half.
static void reach_of(double across, double ahead, double radius, double half, int size, int *first,
                     int *last) {
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

static void reach_of_sphere(struct world *w, int i, const struct shape *shape,
                            const struct view *view, const struct frame *frame) {
    double from[3], unit = ldexp(1, w->format.unit), half = view->tan_half_fov / frame->height;
    for (int k = 0; k < 3; k++)
        from[k] = (shape->position[k] - view->position[k]) / unit;
    double far_sq = dot(from, from), radius = shape->sphere.radius / unit;
    // What rounding makes of it: b² is off by twice the direction's error, the rest by a few of the last bits.
    radius = sqrt(radius * radius + 2 * direction_error(&w->format) * (far_sq + sqrt(far_sq) + 1));
    double ahead = dot(from, view->forward);
    reach_of(dot(from, view->right), ahead, radius, half, frame->width, &w->reach[0][i],
             &w->reach[1][i]);
    reach_of(-dot(from, view->up), ahead, radius, half, frame->height, &w->reach[2][i],
             &w->reach[3][i]);
}

// A ray's direction before it is normalised may be as long as it likes: at most four, by a power of two. What right and
// up are multiplied by is a factor, too: it is made as much shorter as its range asks for, they by the rest.
static void aim(struct world *w, const struct view *view, const struct frame *frame) {
    const struct format *f = &w->format;
    double half = view->tan_half_fov / frame->height;
    int smaller = directions_shorter(view, (double)frame->width / frame->height), exponent;
    int factors =
        smaller + f->bits > 28 ? smaller + f->bits - 28 : 0; // they are below 2^(smaller + 2)
    frexp(half, &exponent);
    w->finer = 30 - exponent - f->bits + factors; // per_height has 30 bits, as a factor may
    w->per_height = llrint(ldexp(half, 30 - exponent));
    for (int k = 0; k < 3; k++) {
        w->forward[k] = one_of(ldexp(view->forward[k], -smaller), f);
        w->right[k] = one_of(ldexp(view->right[k], factors - smaller), f);
        w->up[k] = one_of(ldexp(view->up[k], factors - smaller), f);
    }
}

void world_look(struct world *w, const struct model *model, const struct view *view,
                const struct frame *frame) {
    const struct format *f = &w->format;
    aim(w, view, frame);
    for (int k = 0; k < 3; k++) {
        w->position[k] = length_of(view->position[k], f);
        w->light[k] = length_of(view->light_position[k], f);
        w->emission[k] = one_of(ldexp(view->light_emission[k], -f->unit), f);
    }
    const double unit = ldexp(1, f->unit);
    for (int i = 0; i < w->count; i++) {
        const struct shape *shape = &model->shapes[i];
        double from[3];
        for (int k = 0; k < 3; k++) {
            from[k] = (view->position[k] - shape->position[k]) / unit;
            w->eye[k][i] = one_of(from[k], f);
        }
        double radius = shape->sphere.radius / unit;
        w->rest[i] = one_of(radius * radius - dot(from, from), f);
        if (f->clear == CLEAR_SAFE || f->clear == CLEAR_LISTS)
            reach_of_sphere(w, i, shape, view, frame);
    }
}
