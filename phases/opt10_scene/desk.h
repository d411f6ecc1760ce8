// A worker's own memory, laid out: its desk, and what that points to.
#ifndef OPT10_DESK_H
#define OPT10_DESK_H

#include "bulb.h"
#include "convex.h"

enum { LISTS = 4 };
#define WHOLE_LINES(size) (((size) + 63) / 64 * 64)
#define DESK_SIZE(shapes)                                                                          \
    (WHOLE_LINES(sizeof(struct desk)) + (ABREAST + 1) * (size_t)(shapes) * sizeof(struct near) +   \
     LISTS * WHOLE_LINES((size_t)(shapes) * sizeof(int)))

static inline struct desk *desk_at(void *own, int shape_count) {
    size_t shapes = (size_t)shape_count;
    struct desk *desk = own;
    char *behind = (char *)own + WHOLE_LINES(sizeof *desk);
    desk->near = (struct near *)behind;
#if !UNROLLED
    behind += (ABREAST + 1) * shapes * sizeof(struct near);
    struct shapes *lists[LISTS] = {&desk->listed, &desk->shading, &desk->casters[0],
                                   &desk->casters[1]};
    for (size_t i = 0; i < LISTS; i++)
        lists[i]->index = (int *)(behind + i * WHOLE_LINES(shapes * sizeof(int)));
#endif
    return desk;
}

#endif
