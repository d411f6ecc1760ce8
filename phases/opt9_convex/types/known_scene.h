// What the code knows about its scene at compile time: here nothing, so that it draws every scene. Code that
// is compiled for one scene has its own header in place of this one (opt10_scene, kernel/kernel_scene.h).
#ifndef OPT9_KNOWN_SCENE_H
#define OPT9_KNOWN_SCENE_H

#include "core/prepared.h"
#include "types/shape_sets.h"

// The scene as `const struct known_scene *`.
#define KNOWN(scene) (&(scene)->known)
#define HAS_BVH(scene) ((scene)->bvh.levels > 0)
#define IS_GROUP(s) ((s)->type == SHAPE_GROUP)
#define FIELD_OF(s) ((s)->field)
#define SHARP_OF(s) ((s)->sharp)
#define HAS_BALLS(s) (IS_GROUP(s) && !SHARP_OF(s) && FIELD_OF(s)->balls.levels > 0)
// INLINE: functions that a kernel compiles anew for each shape. KERNEL_SHARED: functions that another file
// calls. KERNEL_INLINE: both.
#define INLINE static inline
#define KERNEL_SHARED
#define KERNEL_INLINE
// Before a loop over shapes: a kernel unrolls it, so that each shape's numbers are constants in its own code.
#define UNROLL_SHAPES
enum { UNROLLED_SHAPES = 0 }; // number of shapes of an unrolled loop, 0: not unrolled
// WHOLE_SHININESS: the shininess of all shapes if it is one whole number, else 0. ONE_MATERIAL: 1 if all shapes
// have the same material.
enum { WHOLE_SHININESS = 0, ONE_MATERIAL = 0 };
// Packets of shadow rays that cast_packets() marches in turns, and whether it replaces one that has ended at
// once.
enum { PACKETS_IN_WORK = 2, REFILL_PACKETS = 0 };

// Returns whether `a` is known to be (0, 1, 0).
static inline bool axis_is_up(const float a[3]) {
    (void)a;
    return false;
}

#endif
