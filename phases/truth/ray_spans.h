// Where a ray is inside of which shape, in intervals of double and of quad: solve.c.
#ifndef TRUTH_SOLVE_H
#define TRUTH_SOLVE_H

#include <stdbool.h>

#include "dd.h"
#include "interval.h"
#include "scene/scene.h"

// Which part of a shape's surface: half-spaces by number (box: 2·axis + upper; octahedron: bits of
// the signs; cone: BOTTOM, TOP, SIDE), or the side of the cell that a repeated shape is clipped to.
enum { FACE_BOTTOM, FACE_TOP, FACE_SIDE, FACE_CELL = 16, FACE_NONE = -1 };

// What is worked out once per shape.
struct solid {
    const struct shape *shape;
    bool rotated, repeated;
    bool duplicate; // of a shape before it, which then owns every hit
    struct ivd rotation_d[3][3];
    struct ivq rotation_q[3][3]; // world to shape, after the shift by −position
    struct dd rotation[3][3];
};

// Part of a ray inside of a solid, s from `in` to `out`. Not sure: the part may not be there at
// all, and then only in.lo and out.hi bound it.
#define SPAN(IV, name)                                                                             \
    struct name {                                                                                  \
        struct IV in, out;                                                                         \
        int in_face, out_face;                                                                     \
        bool sure, in_face_sure, out_face_sure;                                                    \
        double in_cell[3], out_cell[3];                                                            \
    }
SPAN(ivd, span_d);
SPAN(ivq, span_q);
#undef SPAN

struct ray_d {
    struct ivd o[3], d[3];
};

struct ray_q {
    struct ivq o[3], d[3];
};

// The first zero of the union's surface for 0 ≤ s ≤ reach.
#define FIRST_HIT(IV, name)                                                                        \
    struct name {                                                                                  \
        struct IV s;                                                                               \
        int shape; /* −1: none */                                                                  \
        int face;                                                                                  \
        double cell[3];                                                                            \
        bool proved;                                                                               \
        bool gave_up;           /* gave up in small cells: quads would too */                      \
        bool face_sure, inside; /* the ray started inside of a shape */                            \
    }
FIRST_HIT(ivd, first_d);
FIRST_HIT(ivq, first_q);
#undef FIRST_HIT

struct first_d first_hit_d(const struct solid *solids, int count, const struct ray_d *ray,
                           struct ivd reach, long *evals);
struct first_q first_hit_q(const struct solid *solids, int count, const struct ray_q *ray,
                           struct ivq reach, long *evals);

// s at which the ray leaves the ball about the origin, from within.
struct ivq leave_ball(const struct ray_q *ray, double radius);

#endif
