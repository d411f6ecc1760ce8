// A packet of a Mandelbulb's rays that march in floats, and how the lanes of packets that have ended get rays that wait.
// Included by the source of opt8_streams and of opt9_convex.
#pragma once

struct bulb_lanes {
    vfloat field[B_LANE];
    unsigned live; // a bit for each lane
};

static inline struct vec vec_of_fields(const struct bulb_lanes *from, int first) {
    return (struct vec){from->field[first], from->field[first + 1], from->field[first + 2]};
}

// Gives ended lanes the rays from `next` on. Returns the next one then.
static int refill_bulb(struct bulb_lanes *to, int next, int count, float (*from)[BULB_ROOM]) {
    unsigned ended = ~to->live & ((1u << LANES) - 1);
    int more = __builtin_popcount(ended) - (count - next);
    for (; more > 0; more--)
        ended &= ended - 1;
    if (!ended)
        return next;
    v_expand_rows(to->field, B_LANE, ended, &from[0][next], BULB_ROOM);
    to->live |= ended;
    return next + __builtin_popcount(ended);
}
