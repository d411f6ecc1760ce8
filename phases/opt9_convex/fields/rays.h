// Rays against a group's field: fields/rays.c. simd/simd.h comes before it.
#pragma once

#include "fields/field.h"

// What a group has at its surface: `normal` in its axes, of unit length.
struct field_surface {
    struct vec normal, color;
    vfloat reflectivity, shininess;
};

vfloat field_distance(const struct field *field, struct vec p);
struct field_surface field_surface(const struct field *field, struct vec p, vmask found);

// Returns which rays come to the surface between near and far, and sets t. A ray that begins inside comes to it there.
vmask field_enter(const struct field *field, struct vec o, struct vec d, vmask active, vfloat near,
                  vfloat far, vfloat *t);

// Returns the lesser of `best` and the least distance/t between near and far (opt11_ideal). lit: the ratio of a lit ray.
vfloat field_widest(const struct field *field, struct vec o, struct vec d, vmask active,
                    vfloat near, vfloat far, vfloat best, float lit);
