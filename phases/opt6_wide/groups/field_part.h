// What the hits of a packet on a group are made of.
#pragma once

#include "simd/simd.h"

struct local_ray; // core/shape_distances.h
struct primitive;

// What a group has at a point: its distance's gradient in its frame, and its material.
struct field_part {
    vfloat f;
    struct vec gradient, color;
    vfloat reflectivity, shininess;
};

// Returns the parts at a packet's hits on a group: the point is the origin of the packet's ray in the group's frame.
struct field_part field_at_origin(const struct local_ray *a, const struct primitive *primitive,
                                  vmask found);
