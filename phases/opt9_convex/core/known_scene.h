// What the code knows of its scene when it is compiled: here nothing, so that every scene can be drawn.
// Code that is compiled for one scene has a header of its own in place of this one.
#ifndef OPT9_KNOWN_SCENE_H
#define OPT9_KNOWN_SCENE_H

#include "core/primitive.h"
#include "core/shape_sets.h"

// The scene as `const struct known_scene *`.
#define KNOWN(scene) (&(scene)->known)
#define HAS_BVH(scene) ((scene)->bvh.levels > 0)
// Functions with code of their own for each shape; functions that another file calls; and those that are both.
#define INLINE static inline
#define KERNEL_SHARED
#define KERNEL_INLINE
// A shininess that all shapes have, a whole number, or 0; whether all shapes look alike.
enum { WHOLE_SHININESS = 0, ONE_MATERIAL = 0 };
// Packets of shadow rays that are marched by turns, and whether one that is over makes room for the next at once (shadow/soft_shadow.c).
enum { PACKETS_IN_WORK = 2, REFILL_PACKETS = 0 };

// Whether a direction is known to be (0, 1, 0).
static inline bool axis_is_up(const float a[3]) {
    (void)a;
    return false;
}

#endif
