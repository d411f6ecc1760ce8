// Random scenes for the spans of opt12_fused: two planes, and a solid of each type above them or in part below; camera
// and light above the planes.
#pragma once

#include "tests/c/testing.h"

#include <math.h>
#include <string.h>

#include "scene/scene.h"
#include "scene/vector.h"
#include "tests/c/phases/random_from.h"

#include "spans/band.c"
#include "spans/frame.c"
#include "spans/spacing.c"

#include "scene_kernel.h"

enum { PLANES = 2, SOLIDS = SHAPES - PLANES };
#define BOUNDS 100.0

// A scene's size, and where it is. A small one far from the origin has few bits for its points.
static double unit = 1, away[3];

struct random_scene {
    struct primitive shape[SHAPES];
    struct known_scene known;
    struct view view;
    int width, height;
};

static void direction_from(double v[3]) {
    double square;
    do {
        for (int k = 0; k < 3; k++)
            v[k] = random_from(-1, 1);
        square = dot3(v, v);
    } while (square > 1 || square < 1e-3);
    normalize3(v);
}

// Sets sizes and bound as opt9_convex's prepare_shape() does.
static void set_size(struct primitive *s, double size) {
    double bound = 0;
    for (int k = 0; k < 3; k++)
        s->size[k] = (float)(size * random_from(0.1, 1));
    double half = sqrt((double)s->size[0] * s->size[0] + (double)s->size[1] * s->size[1] +
                       (double)s->size[2] * s->size[2]);
    s->a = (float)(size * random_from(0.3, 1));
    s->b = (float)(s->a * random_from(0.1, 0.9));
    s->c = s->size[0];
    switch (s->type) {
    case SHAPE_SPHERE: bound = s->a; break;
    case SHAPE_BOX: bound = half * (1 + 1e-5); break;
    case SHAPE_ROUNDED_BOX:
        s->a *= 0.3f;
        bound = (half + s->a) * (1 + 1e-5);
        break;
    case SHAPE_TORUS:
        bound = ((double)s->a + s->b) * (1 + 1e-5);
        s->c = (float)ldexp(5e-7, ilogb(s->a + s->b));
        break;
    case SHAPE_CONE: {
        double across = (double)s->b - s->a, up = 2.0 * s->c;
        s->slope[0] = (float)across;
        s->slope[1] = (float)up;
        s->per_slope_sq = (float)(1 / (across * across + up * up));
        bound = hypot(s->a, s->c) * (1 + 1e-5);
        break;
    }
    default: bound = s->a * (1 + 1e-5); break;
    }
    s->bound = (float)bound;
    s->bound_sq = (float)(bound * bound);
}

static void set_solid(struct primitive *s, int index, double size) {
    static const enum shape_type types[SOLIDS] = {SHAPE_SPHERE, SHAPE_BOX,        SHAPE_ROUNDED_BOX,
                                                  SHAPE_TORUS,  SHAPE_OCTAHEDRON, SHAPE_CONE};
    double turn[3], matrix[3][3];
    *s = (struct primitive){.type = types[index % SOLIDS], .index = (float)index, .turned = true};
    s->convex = s->type != SHAPE_TORUS;
    set_size(s, size);
    for (int k = 0; k < 3; k++)
        turn[k] = random_from(-180, 180);
    rotation_matrix(turn, matrix);
    for (int k = 0; k < 3; k++) {
        s->centre[k] = away[k] + unit * random_from(-8, 8);
        s->position[k] = (float)s->centre[k];
        for (int j = 0; j < 3; j++) {
            s->row[k][j] = matrix[k][j];
            s->turn[k][j] = (float)matrix[k][j];
        }
    }
    s->share = index % 2 ? 0.05f : 0.0f;
}

static void set_plane(struct primitive *s, int index) {
    *s = (struct primitive){.type = SHAPE_PLANE,
                            .eval = EVAL_LINEAR,
                            .index = (float)index,
                            .bound = INFINITY,
                            .shininess = 15,
                            .color = {1, 1, 1},
                            .share = 0.03f};
    direction_from(s->row[0]);
    if (index == 0 && random_from(0, 2) < 1)
        memcpy(s->row[0], (double[3]){0, 1, 0}, sizeof s->row[0]);
    s->offset = dot3(s->row[0], away) + unit * random_from(-12, -4);
    for (int k = 0; k < 3; k++)
        s->normal[k] = (float)s->row[0][k];
    s->c = (float)s->offset;
}

static double height_of(const struct primitive *plane, const double p[3]) {
    return dot3(plane->row[0], p) - plane->offset;
}

// Whether a camera there can be drawn by closed forms.
static bool is_clear(const struct random_scene *scene, const double p[3]) {
    bool clear = dot3(p, p) < 0.9 * BOUNDS * BOUNDS;
    for (int i = 0; i < SHAPES; i++) {
        const struct primitive *s = &scene->shape[i];
        double to[3];
        span_along(s->centre, p, -1, to);
        clear = clear && (i < PLANES ? height_of(s, p) > 0.1 * unit
                                     : sqrt(dot3(to, to)) > 1.0002 * s->bound);
    }
    return clear;
}

static void place(const struct random_scene *scene, double most, double p[3]) {
    do {
        direction_from(p);
        for (int k = 0; k < 3; k++)
            p[k] = away[k] + unit * most * p[k];
    } while (!is_clear(scene, p) && (most *= 0.99) > 0);
}

static void aim(struct random_scene *scene, const double at[3]) {
    double up[3];
    do
        direction_from(up);
    while (view_aim(&scene->view, at, up) != AIM_OK);
}

static void set_scene(struct random_scene *scene, int width, int height) {
    memset(scene, 0, sizeof *scene);
    for (int i = 0; i < PLANES; i++)
        set_plane(&scene->shape[i], i);
    for (int i = PLANES; i < SHAPES; i++)
        set_solid(&scene->shape[i], i, unit * pow(10, random_from(-0.7, 0.4)));
    scene->known.primitives = scene->shape;
    scene->known.model = (struct known_model){.shape_count = SHAPES,
                                              .shadows = SHADOWS_SOFT,
                                              .shadow_strength = pow(10, random_from(0.1, 1)),
                                              .fog = 5e-6,
                                              .march = {BOUNDS, 1e-4, 1e-3 * unit, 3}};
    scene->width = width;
    scene->height = height;
    place(scene, random_from(10, 40), scene->view.position);
    place(scene, random_from(10, 80), scene->view.light_position);
    double at[3];
    for (int k = 0; k < 3; k++)
        at[k] = away[k] + unit * random_from(-5, 5);
    aim(scene, at);
    scene->view.tan_half_fov = random_from(0.2, 1);
    for (int k = 0; k < 3; k++)
        scene->view.light_emission[k] = 50;
}

// The point of solid i that is farthest along m, of unit length.
static inline void farthest_point(const struct random_scene *scene, int i, const double m[3],
                                  double p[3]) {
    const struct primitive *s = &scene->shape[i];
    double local[3], at[3];
    for (int k = 0; k < 3; k++)
        local[k] = dot3(s->row[k], m);
    struct span_hull hull = {s, s->bound, 0};
    if (s->type == SHAPE_TORUS) {
        double round = hypot(local[0], local[2]);
        for (int k = 0; k < 3; k++)
            at[k] = s->b * local[k] + (k == 1 ? 0 : s->a * local[k] / round);
    } else if (!support_point(&hull, local, at)) {
        for (int k = 0; k < 3; k++)
            at[k] = s->a * local[k];
    }
    for (int k = 0; k < 3; k++)
        p[k] = s->centre[k] + s->row[0][k] * at[0] + s->row[1][k] * at[1] + s->row[2][k] * at[2];
}

// A direction in which a plane may touch solid j and, on its other side, the ball of light.
static inline void between(const struct random_scene *scene, int j, double q, double m[3]) {
    double to[3];
    span_along(scene->view.light_position, scene->shape[j].centre, -1, to);
    double far = sqrt(dot3(to, to)),
           sine = fmin(q * random_from(1, 1.5) + scene->shape[j].bound / far, 1);
    direction_from(m);
    span_along(m, to, -dot3(m, to) / (far * far), m);
    normalize3(m);
    for (int k = 0; k < 3; k++)
        m[k] = sqrt(1 - sine * sine) * m[k] + sine * to[k] / far;
}

static inline void point_of(const struct random_scene *scene, int i, double p[3]) {
    double m[3];
    direction_from(m);
    farthest_point(scene, i, m, p);
}

static const struct fused_span *span_at(const struct fused_span *spans, int x) {
    while (spans->x1 <= x)
        spans++;
    return spans;
}
