// The field of a group along a ray, enclosed with its derivative, and what follows from it: gradient, material, the
// ideal shadow's least ratio. common/scene/scene.h defines the field.
#pragma once

#include "number/dd.h"
#include "spans/ray_spans.h"

// A function of s on [lo, hi], enclosed: `at` its value at the m that was given, `over` all its values, `slope` its
// derivatives. Where it has a kink: all slopes of chords (F. H. Clarke, "Optimization and Nonsmooth Analysis", 1983:
// the generalized gradient, for which G. Lebourg's mean value theorem holds).
#define JET(IV, name)                                                                              \
    struct name {                                                                                  \
        struct IV at, over, slope;                                                                 \
        bool rough; /* it may jump, so nothing is known of the slope */                            \
    }
JET(ivd, jet_d);
JET(ivq, jet_q);
#undef JET

// Fields along one ray, given in the frame of the group or, if `outer`, of the scene. It remembers which nodes do not
// matter in an interval for the intervals within it. NULL if memory is short.
struct field_d *field_open_d(const struct solid *group, const struct ray_d *ray, bool outer);
struct field_q *field_open_q(const struct solid *group, const struct ray_q *ray, bool outer);

// Close it, and return the number of its evaluations.
long field_close_d(struct field_d *field);
long field_close_q(struct field_q *field);

// Enclose the field, which is not yet divided by the root's Lipschitz constant, for lo ≤ m ≤ hi.
struct jet_d field_over_d(struct field_d *field, double lo, double m, double hi);
struct jet_q field_over_q(struct field_q *field, quad lo, quad m, quad hi);

// Encloses the gradient of the field at a point of the group's frame, and computes the material there. Returns whether
// the material is certain.
bool field_surface(const struct solid *group, const struct ivq p[3],
                   const struct material *materials, struct ivq gradient[3],
                   struct material *material);

// Returns the least strength·h(t)/t over [start, end] of a group along a ray of the scene with unit direction, to 1e-7,
// or `best` if that is less. h: the distance, the field divided by the root's Lipschitz constant.
double field_least_ratio(const struct solid *group, const struct ray_d *ray, double start,
                         double end, double strength, double best);

// Returns a lower bound of a node's field where its points are within `spread` of p, if it is above 0, by the node's
// sphere.
static inline double bound_by_sphere(const struct node *node, const double p[3], double spread) {
    double square = 0, size = node->radius + spread;
    for (int i = 0; i < 3; i++) {
        double d = p[i] - node->centre[i];
        square += d * d;
        size += fabs(p[i]) + fabs(node->centre[i]);
    }
    return node->growth * (sqrt(square) - node->radius - spread - 1e-12 * size) * (1 - 1e-12);
}

// sdf_group.c: the field at a point of the group's frame in double-double.
struct dd field_at(const struct solid *group, const struct dd p[3]);
