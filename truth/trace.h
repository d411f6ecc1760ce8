// What the files of this phase use of each other: hits, normals, shadows, shading.
#pragma once

#include "scene/scene.h"
#include "spans/ray_spans.h"

// The names of phase.json's "planes", in its order.
enum plane {
    PLANE_IDEAL,
    PLANE_NONE = 3,
    PLANE_SHADOW = 6,
    PLANE_SHADOW_IDEAL,
    PLANE_WIDTH,
    PLANE_STATUS,
    PLANE_STATUS_ALL,
    PLANE_SURFACE, // planes of the exact surface's picture: 0 without one
    PLANE_SURFACE_IDEAL = PLANE_SURFACE + 3,
    PLANE_SURFACE_Z = PLANE_SURFACE_IDEAL + 3,
    PLANE_SURFACE_ID,
    PLANE_SURFACE_NORMAL,
    PLANE_SURFACE_STATUS = PLANE_SURFACE_NORMAL + 3,
    PLANE_SURFACE_WIDTH
};

enum status { UNDECIDED, MARCHED, PROVED };

struct prepared {
    struct model model;
    struct solid *solids; // of the shapes, then of the nodes
    struct workers *workers;
    bool fractals, provable; // provable: there are Mandelbulbs, and no fractal besides
    bool exact;              // hits of Mandelbulbs are proved ones, not a march's
};

struct hit {
    int shape; // −1: none
    int face;
    double cell[3];
    struct ivq s, t; // p = o + s·d, t = s·|d|
    quad shown_t;    // the t in the picture: the middle of t if it is decided
    struct ivq point[3];
    struct ivq normal[3]; // of unit length, against the ray
    enum status status;
    struct material material;
    bool normal_sure; // and the material
    long evals;
};

// Each picture has three kinds of shadow: by the phases' estimator, ideal, none.
enum { SHADOW_ESTIMATE, SHADOW_IDEAL, SHADOW_NONE, SHADOW_KINDS };

struct shaded {
    double color[SHADOW_KINDS][3];
    double shadow[SHADOW_KINDS]; // at the first hit
    struct hit hit;
    enum status status_all; // the least of all rays that the colour depends on
};

// sdf.c, in double-double: for the soft shadow's estimator, fractals and phase_distances.

// Moves, rotates and wraps a point into the shape's own frame.
void to_frame(const struct solid *solid, const struct dd p[3], struct dd local[3]);

// Returns the signed distance of a shape that is no group at a point of its own frame.
struct dd shape_distance(const struct shape *shape, const struct dd local[3]);

// groups/sdf_group.c: returns the shape's signed distance at a point of the scene; a fractal's is an estimate.
struct dd distance_to(const struct solid *solid, const struct dd p[3]);

// Returns the distance to the nearest shape, in double-double, and its index; `fractals`: of fractals alone.
struct dd distance_to_scene(const struct prepared *prepared, const struct dd p[3], bool fractals,
                            int *nearest);

// Finds the first hit: shape, s, t, point and status. A repeated or rotated shape is solved in its own frame.
void find_hit(const struct prepared *prepared, const struct ray_q *ray, struct hit *hit);

// Computes the enclosed unit normal of a hit, against the ray, and the material. normal_sure: the hit is on one face, of
// one material.
void find_normal(const struct prepared *prepared, const struct ray_q *ray, struct hit *hit);

// Computes the share of the light that reaches the hit, by kind of shadow. Returns the status of a hard shadow.
enum status find_shadow(const struct prepared *prepared, const struct hit *hit,
                        const struct view *view, double factor[SHADOW_KINDS]);

// Traces a ray, after `bounce` mirrors: hit, colours and shadows.
void trace(const struct prepared *prepared, const struct view *view, const struct ray_q *ray,
           int bounce, struct shaded *result);
