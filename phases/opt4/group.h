// Groups of shapes (group.c): what a primitive holds of them, and the closest of them. Included by
// sdf.h, after vec.h.
#pragma once

struct local_ray;
struct prepared;
struct primitive;

struct closest {
    vfloat distance, shape;
};

// The field of the group over its Lipschitz constant, at points of its frame.
vfloat sdf_group(struct vec p, const struct primitive *group);

// Returns the closest shape at distance t along the rays, of all groups and of `least`, the closest of the others. Apart
// from their loop, which a call in it makes slower; cold, so that it keeps its registers.
struct closest closest_group(const struct local_ray *rays, vfloat t, const struct prepared *scene,
                             struct closest least) __attribute__((cold));
