// Rays against a group's field: fields/rays.c. simd/simd.h comes before it.
#pragma once

#include "fields/field.h"

// What a group has at its surface: `normal` in its axes, of unit length.
struct field_surface {
    struct vec normal, color;
    vfloat reflectivity, shininess;
};

// Where a cone of slope q < 1 about each ray meets a sphere.
struct cone_span {
    vmask met;
    vfloat in, out;
};

// v: from the ray's origin to the sphere's centre; d: its direction.
static inline struct cone_span cone_span(struct vec v, vfloat radius, struct vec d, vfloat q) {
    vfloat along = vec_dot(v, d), zero = v_splat(0.0f);
    struct vec aside = vec_along(v, d, zero - along);
    vfloat a = v_nmadd(q, q, v_splat(1.0f)), b = v_madd(q, radius, along);
    // b² − a·c, with c = along² + aside² − radius²
    vfloat rest = v_madd(q, along, radius);
    vfloat inside = v_msub(rest, rest, a * vec_dot(aside, aside));
    vfloat root = v_sqrt(v_max(inside, zero)), per = v_splat(1.0f) / a;
    return (struct cone_span){v_cmp_gt(inside, zero), (b - root) * per, (b + root) * per};
}

// A packet of camera rays in the group's frame, and where they come to its surface.
struct field_rays {
    struct vec d;
    vmask active;
    vmask met;
    vfloat t;
    struct vec point;
};

// Sets the hits of packets side by side, whose rays begin at o. Precondition: the group has balls.
void field_row(const struct field *field, struct vec o, struct field_rays *rays, int packets);

// Returns whether a tile's frustum may meet one of the group's balls. axes: the camera's, in the group's frame. centre: the
// group's, in camera axes. edges: left, right, bottom and top of the tile in the picture's plane at distance 1. sides:
// the lengths of (edge, 1). Precondition: the group has balls.
bool field_in_frustum(const struct field *field, const struct vec axes[3], const float centre[3],
                      const float edges[4], const float sides[4]);

vfloat field_distance(const struct field *field, struct vec p);
struct field_surface field_surface(const struct field *field, struct vec p, vmask found);

// Returns which rays come to the surface between near and far, and sets t. A ray that begins inside comes to it there.
vmask field_enter(const struct field *field, struct vec o, struct vec d, vmask active, vfloat near,
                  vfloat far, vfloat *t);

// Returns the lesser of `best` and the least distance/t between near and far (opt11_ideal). lit: the ratio of a lit ray.
vfloat field_widest(const struct field *field, struct vec o, struct vec d, vmask active,
                    vfloat near, vfloat far, vfloat best, float lit);

// What a generated kernel calls of the program (opt10_scene): the functions above, and sharp_enter() of hit/solids.h.
struct sharp;
struct group_calls {
    void (*row)(const struct field *, struct vec, struct field_rays *, int);
    bool (*in_frustum)(const struct field *, const struct vec[3], const float[3], const float[4],
                       const float[4]);
    vfloat (*distance)(const struct field *, struct vec);
    struct field_surface (*surface)(const struct field *, struct vec, vmask);
    struct field_surface (*sharp_surface)(const struct sharp *, struct vec, vmask);
    vmask (*enter)(const struct field *, struct vec, struct vec, vmask, vfloat, vfloat, vfloat *);
    vmask (*sharp)(const struct sharp *, struct vec, struct vec, vmask, vfloat, vfloat, vfloat *);
    // opt11_ideal and later; NULL: none.
    vfloat (*widest)(const struct field *, struct vec, struct vec, vmask, vfloat, vfloat, vfloat,
                     float);
};
