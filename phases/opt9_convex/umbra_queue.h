// Shadow rays in their queue: taken out in packets, their light given back lane by lane.
#ifndef OPT9_UMBRA_QUEUE_H
#define OPT9_UMBRA_QUEUE_H

#include "umbra.h"

static struct rays waiting(float field[][QUEUE_ROOM], int first, int count) {
    COUNT(waiting, call);
    int left = count - first;
    return (struct rays){.active = first_lanes(left < 0       ? 0
                                               : left < LANES ? left
                                                              : LANES),
                         .point = load_vec(field + S_POINT, first),
                         .local = load_vec(field + S_LOCAL, first),
                         .to_light = load_vec(field + S_TO_LIGHT, first),
                         .facing = load(&field[S_FACING][first]),
                         .shape = load(&field[S_SHAPE][first]),
                         .end = set(0.0f),
                         .alone = set(INFINITY),
                         .on_plane = no_lane(),
                         .some = no_lane(),
                         .many = no_lane(),
                         .first = set(INFINITY),
                         .cosine = set(1.0f)};
}

static void add_lane(int i, float lit, struct desk *desk) {
    COUNT(add_lane, call);
    float (*field)[QUEUE_ROOM] = desk->shadow;
    int pixel = (int)field[S_PIXEL][i];
    for (int k = 0; k < 3; k++)
        desk->color[k * COLOR_ROOM + pixel] += lit * field[S_LIGHT + k][i];
}

#endif
