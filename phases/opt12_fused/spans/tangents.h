// Half-spaces that hold what a convex solid hides from a point, or darkens of the light of a ball (PROOFS.md, 1. and
// 6.). Plain doubles; lengths in scene units.
#pragma once

#include <math.h>
#include <stdbool.h>

#include "core/prepared.h"

static inline double span_dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void span_cross(const double a[3], const double b[3], double to[3]) {
    to[0] = a[1] * b[2] - a[2] * b[1];
    to[1] = a[2] * b[0] - a[0] * b[2];
    to[2] = a[0] * b[1] - a[1] * b[0];
}

// Returns a + b·t.
static inline void span_along(const double a[3], const double b[3], double t, double to[3]) {
    for (int k = 0; k < 3; k++)
        to[k] = a[k] + b[k] * t;
}

// A convex solid, in its own frame, that holds a shape; of a torus its hull. `grow`: it is larger by this all around.
struct span_hull {
    const struct primitive *shape;
    double bound, grow;
};

// Returns the greatest m·p over the hull's points p; m is of unit length.
static inline double span_support(const struct span_hull *hull, const double m[3]) {
    const struct primitive *s = hull->shape;
    double x = fabs(m[0]), y = fabs(m[1]), z = fabs(m[2]), grow = hull->grow;
    double box = s->size[0] * x + s->size[1] * y + s->size[2] * z;
    switch (s->type) {
    case SHAPE_BOX: return grow + box;
    case SHAPE_ROUNDED_BOX: return grow + box + s->a;
    case SHAPE_OCTAHEDRON: return grow + s->a * fmax(x, fmax(y, z));
    case SHAPE_CONE: {
        double round = sqrt(m[0] * m[0] + m[2] * m[2]);
        return grow + fmax(s->a * round - s->c * m[1], s->b * round + s->c * m[1]);
    }
    case SHAPE_TORUS: return grow + s->a * sqrt(m[0] * m[0] + m[2] * m[2]) + s->b;
    default: return grow + hull->bound;
    }
}

// Sets p to a point of the shape itself where m·p is greatest. Returns false if the hull is not the shape.
static inline bool support_point(const struct span_hull *hull, const double m[3], double p[3]) {
    const struct primitive *s = hull->shape;
    int most = fabs(m[0]) >= fabs(m[1]) && fabs(m[0]) >= fabs(m[2]) ? 0
               : fabs(m[1]) >= fabs(m[2])                           ? 1
                                                                    : 2;
    switch (s->type) {
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX:
        for (int k = 0; k < 3; k++)
            p[k] = copysign(s->size[k], m[k]) + (s->type == SHAPE_BOX ? 0 : s->a * m[k]);
        return true;
    case SHAPE_OCTAHEDRON:
        p[0] = p[1] = p[2] = 0;
        p[most] = copysign(s->a, m[most]);
        return true;
    case SHAPE_CONE: {
        double round = sqrt(m[0] * m[0] + m[2] * m[2]);
        bool up = s->b * round + s->c * m[1] > s->a * round - s->c * m[1];
        double per = round > 0 ? (up ? s->b : s->a) / round : 0;
        p[0] = m[0] * per;
        p[1] = up ? s->c : -s->c;
        p[2] = m[2] * per;
        return true;
    }
    default: return false;
    }
}

// Where a solid is seen from, or lit from, in its frame: a ball. axis: from there to the solid's centre; side, up: at
// right angles to it.
struct span_source {
    double at[3], radius, far, axis[3], side[3], up[3];
};

static inline struct span_source source_at(const double at[3], double radius) {
    struct span_source from = {
        {at[0], at[1], at[2]}, radius, sqrt(span_dot(at, at)), {0}, {0}, {0}};
    for (int k = 0; k < 3; k++)
        from.axis[k] = -at[k] / from.far;
    int least = fabs(from.axis[0]) < fabs(from.axis[1]) ? 0 : 1;
    double unit[3] = {least == 0, least == 1, 0};
    span_cross(from.axis, unit, from.side);
    double per = 1 / sqrt(span_dot(from.side, from.side));
    for (int k = 0; k < 3; k++)
        from.side[k] *= per;
    span_cross(from.axis, from.side, from.up);
    return from;
}

enum { TANGENTS = 16 };

// cos and sin of 2πk/16.
static inline double span_turn(int k) {
    static const double turn[TANGENTS] = {
        1,  0.92387953251128674,  0.70710678118654752,  0.38268343236508977,
        0,  -0.38268343236508977, -0.70710678118654752, -0.92387953251128674,
        -1, -0.92387953251128674, -0.70710678118654752, -0.38268343236508977,
        0,  0.38268343236508977,  0.70710678118654752,  0.92387953251128674};
    return turn[k % TANGENTS];
}

// Tangents all around: those that were found, and points of the shape where they touch it.
struct span_tangents {
    bool found[TANGENTS], touch;
    double m[TANGENTS][3], point[TANGENTS][3];
};

// Sets each m, of unit length: the hull is on its one side and the source on its other, m·p <= support <= m·at − radius. It
// leans as little from its direction of side and up as is found. The 16 searches go side by side: each step waits for
// a root and a quotient.
static inline void set_tangents(const struct span_hull *hull, const struct span_source *from,
                                struct span_tangents *t) {
    enum { STEPS = 5 };
    double per = 1 / from->far, sine[TANGENTS];
    for (int k = 0; k < TANGENTS; k++) {
        t->found[k] = false;
        sine[k] = fmin((hull->bound + hull->grow + from->radius) * per, 0.9999);
    }
    for (int step = 0; step < STEPS; step++)
        for (int k = 0; k < TANGENTS; k++) {
            double cosine = sqrt(1 - sine[k] * sine[k]), lean[3];
            for (int a = 0; a < 3; a++)
                lean[a] =
                    cosine * (span_turn(k) * from->side[a] + span_turn(k + 12) * from->up[a]) -
                    sine[k] * from->axis[a];
            double need = (span_support(hull, lean) + from->radius) * per;
            if (need <= sine[k]) {
                t->found[k] = true;
                for (int a = 0; a < 3; a++)
                    t->m[k][a] = lean[a];
            }
            sine[k] = fmin(need + 1e-14, 0.9999);
        }
    t->touch = true;
    for (int k = 0; k < TANGENTS; k++)
        t->touch = t->touch && t->found[k] && support_point(hull, t->m[k], t->point[k]);
}
