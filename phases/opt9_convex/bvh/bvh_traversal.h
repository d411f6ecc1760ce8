// Traversals of the BVH: bvh_list() with spheres in the lanes, bvh_visit() with rays in the lanes.
#pragma once

#include "core/bvh.h"
#include "types/tile_context.h"

static inline int append_planes(const struct prepared *scene, int *list, int count) {
    for (int k = 0; k < scene->plane_count; k++)
        list[count++] = scene->planes[k];
    return count;
}

static inline struct vec vec_of_lane(const struct vec *v, int lane) {
    return (struct vec){v_splat(lane_of(v->x, lane)), v_splat(lane_of(v->y, lane)),
                        v_splat(lane_of(v->z, lane))};
}

// A node on the traversal stack, in one word with its level in the low bits.
enum { LEVEL_BITS = 2 };

_Static_assert(BVH_LEVELS <= 1 << LEVEL_BITS, "room for a level");

enum {
    STACK_ROOM = BVH_LEVELS * BVH_WIDTH + LANES
}; // room for all, and for what a row writes behind them

static inline int pack_node(int level, int node) {
    return node << LEVEL_BITS | level;
}

static inline int node_level(int waiting) {
    return waiting & ((1 << LEVEL_BITS) - 1);
}

static inline int node_index(int waiting) {
    return waiting >> LEVEL_BITS;
}

// Pushes the entries of `those`, from entry `first` on. Returns their number. LANES words are written.
static inline int push_nodes(vmask those, int level, int first, int waiting[LANES]) {
    v_compress_store_lanes(those, pack_node(level - 1, first), LEVEL_BITS, waiting);
    return __builtin_popcount(v_mask_bits(those));
}

// Returns which spheres, one per lane, may matter.
typedef vmask sphere_test(struct vec centre, vfloat radius, const void *with);

enum { NODES = BVH_WIDTH * BVH_WIDTH }; // at most in a level

_Static_assert(BVH_LEVELS == 3, "room for the nodes of a level");

// Lists the leaves that pass the test, in no particular order. Returns their number; up to LANES words behind
// the last are overwritten. Level by level and branch-free, so that no node's test waits for another's.
__attribute__((always_inline)) static inline int bvh_list(const struct bvh *tree, sphere_test *test,
                                                          const void *with, int *list) {
    int nodes[2][NODES + LANES]; // not zeroed
    int listed = 1;
    nodes[~tree->levels & 1][0] = 0;
    for (int level = tree->levels - 1; level >= 0; level--) {
        const struct sphere_array *s = &tree->level[level];
        const int *from = nodes[level & 1];
        int *to = level > 0 ? nodes[~level & 1] : list, count = listed;
        listed = 0;
        for (int i = 0; i < count; i++) {
            int end = int_min(s->count, (from[i] + 1) * BVH_WIDTH);
            for (int first = from[i] * BVH_WIDTH; first < end; first += LANES) {
                struct vec centre = {v_load(s->x + first), v_load(s->y + first),
                                     v_load(s->z + first)};
                vmask matter =
                    v_and(test(centre, v_load(s->radius + first), with), v_mask_first(end - first));
                if (level > 0)
                    v_compress_store_lanes(matter, first, 0, to + listed);
                else
                    v_compress_store_int(matter, tree->shape + first, to + listed);
                listed += __builtin_popcount(v_mask_bits(matter));
            }
        }
    }
    return listed;
}

// The same with rays in the lanes, one sphere at a time.
typedef bool ray_test(const float centre[3], float radius, void *with);

typedef void leaf_visit(int shape, void *with);

__attribute__((always_inline)) static inline void bvh_visit(const struct bvh *tree, ray_test *test,
                                                            leaf_visit *visit, void *with) {
    int waiting[STACK_ROOM];
    waiting[0] = pack_node(tree->levels - 1, 0);
    for (int count = 1; count > 0;) {
        int level = node_level(waiting[--count]), node = node_index(waiting[count]);
        const struct sphere_array *s = &tree->level[level];
        int end = int_min(s->count, (node + 1) * BVH_WIDTH);
        for (int entry = node * BVH_WIDTH; entry < end; entry++) {
            if (!test((float[3]){s->x[entry], s->y[entry], s->z[entry]}, s->radius[entry], with))
                continue;
            if (level == 0)
                visit(tree->shape[entry], with);
            else
                waiting[count++] = pack_node(level - 1, entry);
        }
    }
}

// Returns the radius of a sphere with a margin for the rounding of v, a difference of points of size `reach`.
static inline vfloat radius_with_rounding(vfloat radius, struct vec v, vfloat reach) {
    vfloat size = v_abs(v.x) + v_abs(v.y) + v_abs(v.z) + reach;
    return v_madd(v_splat(1e-6f), size, radius * v_splat(1 + 1e-5f));
}
