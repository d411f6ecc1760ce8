// A worker's own memory, laid out: its desk, and what that points to.
#ifndef OPT9_WORKER_SCRATCH_H
#define OPT9_WORKER_SCRATCH_H

#include "core/tile_context.h"
#include "shadow/shadow_rays.h"

// Packets whose shadow rays know something of every shape: those in work; of a crowd one, and behind it its vicinity, which
// takes the room of two.
enum {
    CANDIDATE_SLOTS = PACKETS_IN_WORK > 3 ? PACKETS_IN_WORK : 3,
    SCRATCH_LISTS = 4 + GROUP + PACKETS_IN_WORK
};
_Static_assert((int)REFILLED_PACKETS >= (int)CANDIDATE_SLOTS,
               "a kernel's desk has room for a Mandelbulb's streams");
#define WHOLE_LINES(size) (((size) + 63) / 64 * 64)
// A list of shapes, and room for a row of lanes behind them (bvh_list).
#define LIST_SIZE(shapes) WHOLE_LINES(((size_t)(shapes) + LANES) * sizeof(int))
// nears: of how many packets of shadow rays what they know of every shape.
#define SCRATCH_SIZE(shapes, nears)                                                                \
    (WHOLE_LINES(sizeof(struct worker_scratch)) +                                                  \
     (size_t)(nears) * (size_t)(shapes) * sizeof(struct shadow_candidate) +                        \
     SCRATCH_LISTS * LIST_SIZE(shapes))

static inline struct worker_scratch *scratch_at(void *own, int shape_count, int nears) {
    size_t shapes = (size_t)shape_count;
    struct worker_scratch *scratch = own;
    char *behind = (char *)own + WHOLE_LINES(sizeof *scratch);
    scratch->near = (struct shadow_candidate *)behind;
    behind += (size_t)nears * shapes * sizeof(struct shadow_candidate);
    scratch->mirror_list = (int *)behind;
    behind += LIST_SIZE(shapes);
    scratch->active_list = (int *)behind;
    behind += LIST_SIZE(shapes);
    scratch->row_list = (int *)behind;
    behind += GROUP * LIST_SIZE(shapes);
    set_list_room(&scratch->camera_list_count, (int *)behind);
    behind += LIST_SIZE(shapes);
    set_list_room(&scratch->occluders, (int *)behind);
    for (int i = 0; i < PACKETS_IN_WORK; i++) {
        behind += LIST_SIZE(shapes);
        set_list_room(&scratch->candidates[i], (int *)behind);
    }
    reset_scratch(scratch);
    return scratch;
}

#endif
