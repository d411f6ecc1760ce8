// The layout of a worker's memory: struct worker_scratch, and behind it the arrays that it points to.
#pragma once

#include "shadow/shadow_rays.h"
#include "types/tile_context.h"

// CANDIDATE_SLOTS: packets of shadow rays with a candidate for every shape. With a BVH: one packet, and the
// active set in the room of two.
enum {
    CANDIDATE_SLOTS = PACKETS_IN_WORK > 3 ? PACKETS_IN_WORK : 3,
    SCRATCH_LISTS = 4 + GROUP + PACKETS_IN_WORK
};
_Static_assert((int)REFILLED_PACKETS >= (int)CANDIDATE_SLOTS,
               "a kernel's scratch memory has room for the packets of a Mandelbulb");
#define WHOLE_LINES(size) (((size) + 63) / 64 * 64)
// Bytes of a list of shapes, with room for LANES more (bvh_list).
#define LIST_SIZE(shapes) WHOLE_LINES(((size_t)(shapes) + LANES) * sizeof(int))
// Bytes of a worker's memory. slots: packets of shadow rays that have candidates.
#define SCRATCH_SIZE(shapes, slots)                                                                \
    (WHOLE_LINES(sizeof(struct worker_scratch)) +                                                  \
     (size_t)(slots) * (size_t)(shapes) * sizeof(struct shadow_candidate) +                        \
     SCRATCH_LISTS * LIST_SIZE(shapes))

static inline struct worker_scratch *scratch_at(void *memory, int shape_count, int candidates) {
    size_t shapes = (size_t)shape_count;
    struct worker_scratch *scratch = memory;
    char *behind = (char *)memory + WHOLE_LINES(sizeof *scratch);
    scratch->candidates = (struct shadow_candidate *)behind;
    behind += (size_t)candidates * shapes * sizeof(struct shadow_candidate);
    scratch->mirror_list = (int *)behind;
    behind += LIST_SIZE(shapes);
    scratch->active_list = (int *)behind;
    behind += LIST_SIZE(shapes);
    scratch->row_list = (int *)behind;
    behind += GROUP * LIST_SIZE(shapes);
    set_list_room(&scratch->camera_shapes, (int *)behind);
    behind += LIST_SIZE(shapes);
    set_list_room(&scratch->occluders, (int *)behind);
    for (int i = 0; i < PACKETS_IN_WORK; i++) {
        behind += LIST_SIZE(shapes);
        set_list_room(&scratch->listed[i], (int *)behind);
    }
    reset_scratch(scratch);
    return scratch;
}
