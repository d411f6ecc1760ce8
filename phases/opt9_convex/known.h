// What the code knows of its scene when it is compiled: here nothing, so that every scene can be drawn.
// Code that is compiled for one scene has a header of its own in place of this one.
#ifndef OPT9_KNOWN_H
#define OPT9_KNOWN_H

#include "placed.h"
#include "shapes.h"

// The scene as `const struct known *`.
#define KNOWN(scene) (&(scene)->known)
#define IS_CROWD(scene) ((scene)->tree.levels > 0)
// Functions with code of their own for each shape; functions that another file calls; and those that are both.
#define INLINE static inline
#define SHARED
#define KNOWN_SHARED
// A shininess that all shapes have, a whole number, or 0; whether all shapes look alike.
enum { WHOLE_SHININESS = 0, ONE_MATERIAL = 0 };
// Packets of shadow rays that are marched by turns, and whether one that is over makes room for the next at once (umbra.c).
enum { CASTS = 2, REFILL_CASTS = 0 };

// Whether a direction is known to be (0, 1, 0).
static inline bool is_up(const float a[3]) {
    (void)a;
    return false;
}

#endif
