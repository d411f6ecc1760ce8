// The spans of a ray inside of solids, and the first surface on it, in intervals of double and of quad.
#pragma once

#include <stdbool.h>

#include "number/dd.h"
#include "number/interval.h"
#include "scene/scene.h"

// A face of a shape. A box has 2·axis + 1 for the upper side, an octahedron a bit for each sign, a cone BOTTOM, TOP and
// SIDE. From CELL on: a wall of the cell that a repeated shape is clipped to, 2·axis + 1 for the upper one.
enum { FACE_BOTTOM, FACE_TOP, FACE_SIDE, FACE_CELL = 16, FACE_NONE = -1 };

// A shape with what is computed once per scene.
struct solid {
    const struct shape *shape;
    const struct node *nodes;   // of a group: the model's,
    const struct solid *inside; // and of each node its frame
    bool rotated, repeated;
    bool duplicate; // of a shape before it, which then owns every hit
    struct ivd rotation_d[3][3];
    struct ivq rotation_q[3][3]; // from the scene's axes to the shape's
    struct dd rotation[3][3];
};

// A span of a ray inside of a solid: s from `in` to `out`, each enclosed. If it is not sure, the span may be missing,
// and only in.lo and out.hi bound it.
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

// The first point on the surface of the union of all solids, for 0 ≤ s ≤ reach.
#define FIRST_HIT(IV, name)                                                                        \
    struct name {                                                                                  \
        struct IV s;                                                                               \
        int shape; /* −1: none */                                                                  \
        int face;                                                                                  \
        double cell[3];                                                                            \
        bool proved;                                                                               \
        bool gave_up;           /* too many cells: quads would give up, too */                     \
        bool face_sure, inside; /* inside: the ray starts in a solid */                            \
    }
FIRST_HIT(ivd, first_d);
FIRST_HIT(ivq, first_q);
#undef FIRST_HIT

// Return the first surface on the ray, proved or with an enclosure of where it may be. `evals` is increased by the
// number of copies and quartics that were solved. A duplicate solid and a fractal have no surface here.
struct first_d first_hit_d(const struct solid *solids, int count, const struct ray_d *ray,
                           struct ivd reach, long *evals);
struct first_q first_hit_q(const struct solid *solids, int count, const struct ray_q *ray,
                           struct ivq reach, long *evals);

// Returns the s at which a ray that starts in the ball about the origin leaves it.
struct ivq leave_ball(const struct ray_q *ray, double radius);
