// In a kernel, in place of opt9_convex's core/known_scene.h: what the code knows of its scene when it is compiled. That is all of
// struct known_scene, and what scene_kernel.h says (kernel/generate.c writes it): the code for each shape stands by itself.
#ifndef OPT9_KNOWN_SCENE_H
#define OPT9_KNOWN_SCENE_H

#define SCENE_KERNEL 1

#include "core/primitive.h"

#include "scene_kernel.h"

#define KNOWN(scene) (&scene_known)
// Crowds have no kernel. Code that draws them is not called here, nor is it in here.
#define HAS_BVH(scene) false
#define INLINE __attribute__((always_inline)) static inline
#define KERNEL_SHARED static
#define KERNEL_INLINE INLINE
enum { PACKETS_IN_WORK = 4, REFILL_PACKETS = 1 };

static inline bool axis_is_up(const float a[3]) {
    return a[0] == 0.0f && a[1] == 1.0f && a[2] == 0.0f;
}

#if UNROLLED
// A set of shapes, a bit for each; EACH_SHAPE and EACH_IN are in scene_kernel.h, written out.
struct shape_set {
    unsigned in;
};

static inline void set_list_room(struct shape_set *set, int *room) {
    (void)set;
    (void)room;
}

static inline void clear_set(struct shape_set *set) {
    set->in = 0;
}

static inline void add_to_set(struct shape_set *set, int i) {
    set->in |= 1u << i;
}

static inline bool is_set_empty(const struct shape_set *set) {
    return set->in == 0;
}

#define EACH_HIT(m, shape, scene, visit, ...) EACH_SHAPE(scene, visit, __VA_ARGS__)
#define EACH_ALIKE(scene, visit, first, ...) EACH_SHAPE(scene, visit, first, __VA_ARGS__)
#else
#include "core/shape_sets.h"
#endif

#endif
