// Shadow rays in their queue, taken out in packets.
#ifndef OPT9_UMBRA_QUEUE_H
#define OPT9_UMBRA_QUEUE_H

#include "shadow/soft_shadow.h"

// Member by member: of a whole struct gcc makes another one first.
static void load_shadow_packet(float field[][QUEUE_ROOM], int first, int count,
                               struct shadow_rays *r) {
    COUNT(load_shadow_packet, call);
    int left = count - first;
    r->active = v_mask_first(left < 0 ? 0 : left < LANES ? left : LANES);
    r->point = load_vec(field + S_POINT, first);
    r->local = load_vec(field + S_LOCAL, first);
    r->to_light = load_vec(field + S_TO_LIGHT, first);
    r->facing = v_load(&field[S_FACING][first]);
    r->shape = v_load(&field[S_SHAPE][first]);
    r->end = v_splat(0.0f);
    r->alone = v_splat(INFINITY);
    r->on_plane = r->meets_one = r->meets_many = v_mask_none();
    r->first = v_splat(INFINITY);
    r->cosine = v_splat(1.0f);
    r->floor = false;
}

#endif
