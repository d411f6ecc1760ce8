// Rays together: cones of neighbouring pixels and bundles of secondary rays, and which shapes they can meet.
// Cones over distances: J. Amanatides, "Ray tracing with cones" (SIGGRAPH 1984); J. C. Hart, "Sphere tracing" (1996);
// see opt7_tiles/PROOFS.md, 1 and 2, for rods of pixels. Two places |p − q| apart differ in distance by no more than that.
#ifndef TILES_H
#define TILES_H

#include "core/primitive.h"
#include "simd/simd.h"

struct march_scratch; // cones/march_scratch.h
struct ray_group;
struct trace_context; // core/trace_context.h

// A cone of pixels in each lane: |dir − axis| ≤ spread for each of its rays.
struct cone_packet {
    struct vec axis;
    vfloat spread;
    vfloat start; // no ray of it is hit before; +∞: none is at all
};

// Once, for the cones of all levels.
void set_cone_origins(struct point eye, const struct prepared *scene,
                      struct march_scratch *scratch);
// From `start`, where the wider cones end that hold them, among what those have met. Fills start and scratch->met: what
// a ray of the cone can hit between start and the bounds, and what is so near to such a place that the normal there
// asks for it.
void march_cones(struct point eye, vmask active, struct shape_list offered,
                 struct cone_packet *cones, const struct prepared *scene,
                 struct march_scratch *scratch);
// What some of the cones have met; `some`: bits of their lanes.
struct shape_list list_for_children(unsigned some, const vmask *met, const struct prepared *scene,
                                    struct march_scratch *scratch, int *shapes);
// Where a Mandelbulb is on it, `start` is the camera.
struct shape_list list_of_cone(int lane, const struct prepared *scene,
                               struct march_scratch *scratch, float *start);

// By least of distances: where a ray is hit; or that very number.
enum list_kind { LIST_HIT, LIST_NEAREST };

// Lists for the rays of a group, in its beams. LIST_HIT: what a ray can hit, and what is near such a place; LIST_NEAREST: the
// least of all distances is that of the list, everywhere. `length`: of the rays; NULL: to the bounds.
void list_for_bundle(const struct ray_group *rays, const vfloat *length, enum list_kind meant,
                     struct trace_context *world, int *shapes);

#endif
