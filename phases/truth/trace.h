// What render.c, march.c and shade.c call of each other.
#ifndef TRUTH_TRACE_H
#define TRUTH_TRACE_H

#include "ray_spans.h"
#include "scene/scene.h"

// The names of phase.json's "planes", in its order.
enum plane {
    PLANE_IDEAL,
    PLANE_NONE = 3,
    PLANE_SHADOW = 6,
    PLANE_SHADOW_IDEAL,
    PLANE_WIDTH,
    PLANE_STATUS,
    PLANE_STATUS_ALL
};

enum status { UNDECIDED, CONVERGED, PROVED };

struct prepared {
    struct model model;
    struct solid *solids;
    int threads;
    bool bulbs;
};

struct hit {
    int shape; // −1: none
    int face;
    double cell[3];
    struct ivq s, t; // p = o + s·d, t = s·|d|
    quad shown_t;    // t to show: the middle, if it is decided
    struct ivq point[3];
    struct ivq normal[3]; // unit, towards the ray
    enum status status;
    bool normal_sure;
    long evals;
};

// Shadows by the estimator, ideal, none.
enum { SHADOW_ESTIMATE, SHADOW_IDEAL, SHADOW_NONE, SHADOW_KINDS };

struct shaded {
    double color[SHADOW_KINDS][3];
    double shadow[SHADOW_KINDS]; // at the first hit
    struct hit hit;
    enum status status_all; // the least of every ray that the picture hangs on
};

struct dd distance_to_scene(const struct prepared *prepared, const struct dd p[3], int *nearest);
void find_hit(const struct prepared *prepared, const struct ray_q *ray, struct hit *hit);
void find_normal(const struct prepared *prepared, const struct ray_q *ray, struct hit *hit);
// Factors of SOFT and IDEAL. Returns how sure the hard shadow is.
enum status find_shadow(const struct prepared *prepared, const struct hit *hit,
                        const struct view *view, double factor[SHADOW_KINDS]);
void trace(const struct prepared *prepared, const struct view *view, const struct ray_q *ray,
           int bounce, struct shaded *result);

#endif
