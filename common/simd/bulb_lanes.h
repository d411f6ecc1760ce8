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

// Returns a packet of queued rays, from ray `first` of `count` on. Lanes without one work on any point.
static inline struct bulb_lanes bulb_lanes_of(float (*rays)[BULB_ROOM], int first, int count) {
    int left = count - first;
    left = left < 0 ? 0 : left < LANES ? left : LANES;
    struct bulb_lanes lanes = {.live = (1u << left) - 1};
    for (int i = 0; i < B_LANE; i++)
        lanes.field[i] = left ? v_load(&rays[i][first]) : v_splat(2.0f);
    return lanes;
}

// Stores the doubles of the lanes in m from place `at` on: each as two floats, `more` rows apart.
static inline void pack_wide(vmask m, vdouble a, float (*field)[BULB_ROOM], int more, int at) {
    vfloat near = v_double_to_float(a);
    v_compress_store(m, near, field[0] + at);
    v_compress_store(m, v_double_residual(a, near), field[more] + at);
}

// Stores the rays' places and directions.
static inline void pack_bulb_rays(vmask m, struct vec_double c, struct vec_double d,
                                  float (*field)[BULB_ROOM], int at) {
    const vdouble values[] = {c.x, c.y, c.z, d.x, d.y, d.z};
    for (int i = 0; i < 6; i++)
        pack_wide(m, values[i], field + i, B_LOW, at);
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
