// Camera and mirror rays through a Mandelbulb. Its estimate is no bound: a march leaps over what is thin, and what
// it finds depends on its steps. So these are the steps of a march from the ray's origin by the least of the
// estimate and the distance to the scene's plane, as in every phase; rays that miss the bounding sphere take none.
// Two packets by turns, whose lanes are filled again from the rays
// that wait as soon as enough of them have ended.
#include "bulb.h"
#include "convex.h"

#include <stdalign.h>

enum { REFILL = LANES / 4 }; // ended lanes

struct lanes {
    alignas(64) float field[B_FIELDS][LANES];
    unsigned live; // a bit for each lane
};

static int refill(struct lanes *to, int next, int count, const struct desk *desk) {
    for (unsigned ended = ~to->live & ((1u << LANES) - 1); ended && next < count; ended &= ended - 1, next++) {
        int lane = __builtin_ctz(ended);
        for (int i = 0; i < B_FIELDS; i++)
            to->field[i][lane] = desk->bulb[i][next];
        to->live |= 1u << lane;
    }
    return next;
}

struct packet {
    struct vec origin, direction;
    real t, to;
    real height, slope; // of the plane
    mask done, met;
};

static inline struct packet packet_of(const struct lanes *from) {
    return (struct packet){{load(from->field[0]), load(from->field[1]), load(from->field[2])},
                           {load(from->field[3]), load(from->field[4]), load(from->field[5])},
                           load(from->field[B_FROM]),
                           load(from->field[B_TO]),
                           load(from->field[B_HEIGHT]),
                           load(from->field[B_SLOPE]),
                           lanes_of(~from->live),
                           no_lane()};
}

static inline void advance(struct packet *p, real h, real hit_distance) {
    real height = mul_add(p->t, p->slope, p->height);
    mask reached = but_not(p->done, less(least_of(h, height), hit_distance));
    p->t = p->t + drop(p->done, least_of(h, height));
    p->met = either(p->met, both(reached, not_less(height, h)));
    p->done = either(p->done, either(reached, greater(p->t, p->to)));
}

// What has ended gives its answer and is no longer live.
static void retire(const struct packet *p, struct lanes *from, struct desk *desk) {
    unload(p->t, from->field[B_FROM]);
    unsigned ended = bits(p->done) & from->live;
    for (unsigned rest = ended; rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest);
        if (bits(p->met) >> lane & 1) {
            int slot = (int)from->field[B_SLOT][lane];
            float t = from->field[B_BEFORE][lane] + from->field[B_FROM][lane];
            if (t < desk->met[slot]) {
                desk->met[slot] = t;
                desk->met_shape[slot] = desk->shape;
            }
        }
    }
    from->live &= ~ended;
}

void march_bulb(const struct placed *s, int count, const struct limits *limits, struct desk *desk) {
    desk->shape = s->index;
    struct lanes lanes[ABREAST];
    for (int k = 0; k < ABREAST; k++) {
        lanes[k].live = 0;
        for (int i = 0; i < B_FIELDS; i++) // a point to work on, and nothing comes of it
            unload(set(2.0f), lanes[k].field[i]);
    }
    // Finer than float tells points of its size apart no march can go.
    real hit_distance = set(fmaxf((float)limits->hit_distance, 0x1p-22f));
    int next = 0;
    unsigned live;
    long left = (long)limits->max_steps * (count / LANES + ABREAST);
    do {
        struct packet p[ABREAST];
        mask done[ABREAST];
        int ended = 0;
        for (int k = 0; k < ABREAST; k++) {
            next = refill(&lanes[k], next, count, desk);
            p[k] = packet_of(&lanes[k]);
            done[k] = p[k].done;
            ended += count_of(done[k]);
        }
        int enough = next < count ? ended + REFILL : ABREAST * LANES;
        while (ended < enough && left-- > 0) {
            struct vec at[ABREAST];
            real h[ABREAST];
            for (int k = 0; k < ABREAST; k++)
                at[k] = vec_along(p[k].origin, p[k].direction, p[k].t);
            bulbs(s, at, done, h);
            ended = 0;
            for (int k = 0; k < ABREAST; k++) {
                advance(&p[k], h[k], hit_distance);
                done[k] = p[k].done;
                ended += count_of(done[k]);
            }
        }
        live = 0;
        for (int k = 0; k < ABREAST; k++) {
            if (left <= 0)
                p[k].done = all_lanes();
            retire(&p[k], &lanes[k], desk);
            live |= lanes[k].live;
        }
    } while (next < count || live);
}
