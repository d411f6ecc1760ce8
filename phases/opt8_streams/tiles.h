// Rays together: cones of neighbouring pixels and bundles of secondary rays, and which shapes they can meet.
// Cones over distances: J. Amanatides, "Ray tracing with cones" (SIGGRAPH 1984); J. C. Hart, "Sphere tracing" (1996);
// see NOTES.md for rods of pixels. Two places |p − q| apart differ in distance by no more than that.
#ifndef TILES_H
#define TILES_H

#include "simd/point.h"
#include "trace.h"

// A worker's memory, of the size that own_size() says.
struct own {
    vfloat *wake; // GROUP for each shape, as the next: of the rays being marched
    struct approach *approach;
    vfloat *eye_wake; // of cones and bundles
    struct approach *eye;
    vfloat *distance;            // at the ends of a bundle's intervals
    struct approach *axis;       // of cones
    vmask *met;                  // lanes whose cone can meet the shape
    int *offered;                // a list of what wider cones have met
    int *tile, *mirror, *shadow; // lists: in the scene's order, and behind it in that of evaluation
    bool *wanted;                // of each shape, on the way to a list
};

size_t own_size(int shapes);
struct own own_of(void *memory, int shapes);

// A cone of pixels in each lane: |dir − axis| ≤ spread for each of its rays.
struct cones {
    struct vec axis;
    vfloat spread;
    vfloat start; // no ray of it is hit before; +∞: none is at all
};

// Once, for the cones of a strip.
void place_cones(struct point eye, const struct prepared *scene, struct own *own);
// From `start`, where the wider cones end that hold them, among what those have met. Fills start and own->met: what
// a ray of the cone can hit between start and the bounds, and what is so near to such a place that the normal there
// asks for it.
void march_cones(struct point eye, vmask active, struct list offered, struct cones *cones,
                 const struct prepared *scene, struct own *own);
// What some of the cones have met; `some`: bits of their lanes.
struct list list_below(unsigned some, const vmask *met, const struct prepared *scene,
                       struct own *own);
// Where a Mandelbulb is on it, `start` is the camera.
struct list list_of_cone(int lane, const struct prepared *scene, struct own *own, float *start);

// What is on the last list_of_cone(), but for Mandelbulbs.
struct list list_without_bulbs(const struct prepared *scene, struct own *own);
// All but the Mandelbulbs, in own->shadow.
struct list list_of_others(const struct prepared *scene, struct own *own);

// By least of distances: where a ray is hit; or that very number.
enum meant { HIT, UNION };

// Lists for the rays of a group, in its beams. HIT: what a ray can hit, and what is near such a place; UNION: the
// least of all distances is that of the list, everywhere. `length`: of the rays; NULL: to the bounds.
void meet(const struct rays *rays, const vfloat *length, enum meant meant, struct world *world,
          int *shapes);

#endif
