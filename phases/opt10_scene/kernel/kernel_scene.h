// In place of types/known_scene.h in a generated kernel: the scene is a constant, so the compiler drops what it
// lacks. kernel/generate.c writes scene_kernel.h, with struct known_scene scene_known.
#ifndef OPT9_KNOWN_SCENE_H
#define OPT9_KNOWN_SCENE_H

#define SCENE_KERNEL 1
#include "core/prepared.h"

#include "scene_kernel.h"

#define KNOWN(scene) (&scene_known)
// Scenes with a BVH have no kernel. Code for them is neither called nor compiled here.
#define HAS_BVH(scene) false
// Groups stay data: the frame's fields, and the program's functions that read them (kernel/group_calls.h).
static const struct prepared *groups_of;
#define IS_GROUP(s) (HAS_GROUPS && (s)->type == SHAPE_GROUP)
#define FIELD_OF(s) (groups_of->primitives[(int)(s)->index].field)
#define SHARP_OF(s) (groups_of->primitives[(int)(s)->index].sharp)
#define HAS_BALLS(s) (IS_GROUP(s) && !SHARP_OF(s) && FIELD_OF(s)->balls.levels > 0)
#define INLINE __attribute__((__always_inline__)) static inline
#define KERNEL_SHARED static
#define KERNEL_INLINE INLINE
enum { UNROLLED_SHAPES = UNROLLED ? SHAPES : 0 };
enum { PACKETS_IN_WORK = 4, REFILL_PACKETS = 1 };

static inline bool axis_is_up(const float a[3]) {
    return a[0] == 0.0f && a[1] == 1.0f && a[2] == 0.0f;
}

#if UNROLLED
#ifdef __clang__
#define UNROLL_SHAPES _Pragma("clang loop unroll(full)")
#else
#define UNROLL_SHAPES _Pragma("GCC unroll 16")
#endif

// A set of shapes, a bit for each.
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

static inline int set_end(const struct shape_set *set) {
    (void)set;
    return SHAPES;
}

static inline bool set_has(const struct shape_set *set, int k) {
    return set->in >> k & 1;
}

static inline int set_shape(const struct shape_set *set, int k) {
    (void)set;
    return k;
}
#else
#define UNROLL_SHAPES
#include "types/shape_sets.h"
#endif

#endif
