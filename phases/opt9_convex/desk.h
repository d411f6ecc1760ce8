// A worker's own memory, laid out: its desk, and what that points to.
#ifndef OPT9_DESK_H
#define OPT9_DESK_H

#include "bulb.h"
#include "convex.h"

// Packets whose shadow rays know something of every shape: those in work; of a crowd one, and behind it its vicinity, which
// takes the room of two.
enum { NEARS = CASTS > 3 ? CASTS : 3, LISTS = 4 + GROUP + CASTS };
_Static_assert((int)POOLS >= (int)NEARS, "a kernel's desk has room for a Mandelbulb's streams");
#define WHOLE_LINES(size) (((size) + 63) / 64 * 64)
// A list of shapes, and room for a row of lanes behind them (list_those).
#define LIST_SIZE(shapes) WHOLE_LINES(((size_t)(shapes) + LANES) * sizeof(int))
// nears: of how many packets of shadow rays what they know of every shape.
#define DESK_SIZE(shapes, nears)                                                                   \
    (WHOLE_LINES(sizeof(struct desk)) + (size_t)(nears) * (size_t)(shapes) * sizeof(struct near) + \
     LISTS * LIST_SIZE(shapes))

static inline struct desk *desk_at(void *own, int shape_count, int nears) {
    size_t shapes = (size_t)shape_count;
    struct desk *desk = own;
    char *behind = (char *)own + WHOLE_LINES(sizeof *desk);
    desk->near = (struct near *)behind;
    behind += (size_t)nears * shapes * sizeof(struct near);
    desk->mirrored = (int *)behind;
    behind += LIST_SIZE(shapes);
    desk->vicinity = (int *)behind;
    behind += LIST_SIZE(shapes);
    desk->cut = (int *)behind;
    behind += GROUP * LIST_SIZE(shapes);
    give_room(&desk->listed, (int *)behind);
    behind += LIST_SIZE(shapes);
    give_room(&desk->shading, (int *)behind);
    for (int i = 0; i < CASTS; i++) {
        behind += LIST_SIZE(shapes);
        give_room(&desk->casters[i], (int *)behind);
    }
    empty_desk(desk);
    return desk;
}

#endif
