// In a kernel, in place of opt9_convex's known.h: what the code knows of its scene when it is compiled. That is all of
// struct known, and what scene_kernel.h says (generate.c writes it): the code for each shape stands by itself.
#ifndef OPT9_KNOWN_H
#define OPT9_KNOWN_H

#include "placed.h"

#include "scene_kernel.h"

#define KNOWN(scene) (&scene_known)
// Crowds have no kernel. Code that draws them is not called here, nor is it in here.
#define IS_CROWD(scene) false
#define INLINE __attribute__((always_inline)) static inline
#define SHARED static
#define KNOWN_SHARED INLINE
enum { CASTS = 4, REFILL_CASTS = 1 };

static inline bool is_up(const float a[3]) {
    return a[0] == 0.0f && a[1] == 1.0f && a[2] == 0.0f;
}

#if UNROLLED
// A set of shapes, a bit for each; EACH_SHAPE and EACH_IN are in scene_kernel.h, written out.
struct shapes {
    unsigned in;
};

static inline void give_room(struct shapes *set, int *room) {
    (void)set;
    (void)room;
}

static inline void none_of(struct shapes *set) {
    set->in = 0;
}

static inline void put_in(struct shapes *set, int i) {
    set->in |= 1u << i;
}

static inline bool is_empty(const struct shapes *set) {
    return set->in == 0;
}

#define EACH_HIT(m, shape, scene, visit, ...) EACH_SHAPE(scene, visit, __VA_ARGS__)
#define EACH_ALIKE(scene, visit, first, ...) EACH_SHAPE(scene, visit, first, __VA_ARGS__)
#else
#include "shapes.h"
#endif

#endif
