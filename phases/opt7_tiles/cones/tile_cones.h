// Cones of neighbouring camera rays, bundles of secondary rays, and the shapes that they can meet. Cones: J.
// Amanatides, "Ray tracing with cones" (SIGGRAPH 1984); J. C. Hart, "Sphere tracing" (1996). Two points p and q differ
// in distance by at most |p − q|: see opt7_tiles/PROOFS.md, 1 and 2.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

struct march_scratch; // cones/march_scratch.h
struct ray_group;
struct trace_context; // core/trace_context.h

// A cone of pixels in each lane: |dir − axis| ≤ spread for each of its rays.
struct cone_packet {
    struct vec axis;
    vfloat spread;
    vfloat start; // no ray of the cone is hit before it; +∞: no ray is hit at all
};

// Sets the origins of the cones' axes, once for the cones of all levels.
void set_cone_origins(struct point eye, const struct prepared *scene,
                      struct march_scratch *scratch);
// Marches cones from cones->start among the shapes `offered`, which wider cones around them have met. Sets
// cones->start and scratch->met: the shapes that a ray of the cone can hit between start and the bounds, and those so
// near to such a hit that its normal needs them.
void march_cones(struct point eye, vmask active, struct shape_list offered,
                 struct cone_packet *cones, const struct prepared *scene,
                 struct march_scratch *scratch);
// Lists the shapes that some of the cones have met, into `shapes`. `some` has a bit for each of their lanes.
struct shape_list list_for_children(unsigned some, const vmask *met, const struct prepared *scene,
                                    struct march_scratch *scratch, int *shapes);
// Lists the shapes that one cone has met. If a fractal is among them, the list has all shapes and `start` becomes
// 0.
struct shape_list list_of_cone(int lane, const struct prepared *scene,
                               struct march_scratch *scratch, float *start);

// What a list must keep: LIST_HIT, every shape that a ray can hit; LIST_NEAREST, every shape that can be the nearest
// anywhere on the ray.
enum list_kind { LIST_HIT, LIST_NEAREST };

// Lists the shapes for the rays of a group, in its packets. LIST_HIT also lists shapes near a hit. LIST_NEAREST keeps
// the least distance the same everywhere. `length` is the rays' length; NULL: to the bounds.
void list_for_bundle(const struct ray_group *rays, const vfloat *length, enum list_kind meant,
                     struct trace_context *world, int *shapes);
