// What render.c, march.c and shade.c call of each other. A packet is eight rays.
#pragma once

#include "frame/frame.h"
#include "sdf.h"

#include "packet/phong.h" // needs sdf.h

struct world {
    const struct prepared *scene;
    const struct view *view;
    struct local_ray *local_rays; // one per shape: those of the packet under way
};

struct hit {
    vmask found;
    vfloat t; // distance along the ray
    struct point point;
    struct vec normal; // towards the ray's origin; 0 where not found
    vfloat shape;      // an integer; −1 where not found
    vfloat evals;      // evaluations of the scene's distance
};

#include "scene/instruction.h" // needs struct primitive

struct shaded {
    struct vec color;
    struct hit hit;
};

// The shapes near a hit.
struct nearest_shape {
    vfloat distance, shape; // of the nearest one
    vmask contact;          // another shape is within two normal steps of it
};

// Marches a packet to its first hits and finds their normals. Afterwards the hits are the origins of
// world->local_rays. Only lanes of `active` are valid in `hit`.
void ray_march(struct point origin, struct vec direction, vmask active, const struct world *world,
               struct hit *hit);

// Returns the light that reaches each point, by the scene's kind of shadows: 0 in shadow, 1 lit, and
// between them in the penumbra of a soft shadow. `distance` is the light's. Precondition: the points
// are the origins of world->local_rays. Only lanes of `active` are valid.
vfloat shadow(struct point point, struct vec to_light, vfloat distance, vmask active,
              const struct world *world);

// Returns the nearest shape of each hit. Precondition: the hits are the origins of world->local_rays.
// It is more exact than the march, whose origins and directions are rounded in each shape's frame.
struct nearest_shape near_hit(vmask found, const struct world *world);

// Returns the unit normals of the hits, on the side of the incoming ray, and 0 in other lanes. `slope`
// gets how fast the distance falls along the ray where the gradient has a closed form, else 1e30:
// a difference quotient at an edge or through a thin plate is no slope to divide by. Precondition: the
// hits are the origins of world->local_rays.
struct vec normal_at(struct vec direction, vmask found, const struct nearest_shape *near,
                     const struct world *world, vfloat *slope);

// Traces a packet and its reflections, up to the scene's number of bounces, and shades its hits. Only
// lanes of `active` are valid in `result`.
void trace(struct point origin, struct vec direction, vmask active, int bounce,
           const struct world *world, struct shaded *result);

// packets.c: a point of the world as sums of two floats; the unit directions of the rays through eight pixels of a row;
// the lanes of a packet of `count` pixels; writes it; memory for the rays in the frames of all shapes.
struct point point_from_doubles(const double a[3]);
struct vec get_direction(int column, int row, const struct frame *frame, const struct view *view);
vmask v_mask_first(int count);
void store(struct frame *frame, size_t pixel, int count, const struct shaded *seen);
struct local_ray *new_local_rays(const struct prepared *prepared);
struct vec vec_from_doubles(const double a[3]);

// group.c: the materials at points of the group's frame.
struct materials group_surface(struct vec p, const struct primitive *group,
                               const struct model *model);
