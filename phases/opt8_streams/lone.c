// Camera rays where one Mandelbulb stands alone, or over a plane. Their steps are those of a march from the camera by the
// least of the estimate and the plane's distance; rays that miss the bounding sphere take none, and such as have passed
// it, or come to the plane, go on in march.c.
// Where a march ends hangs on the last digits of its steps: t is two floats, and near the surface close.h tells them.
// Packets by turns, whose lanes are filled again from the rays that wait as soon as enough of them have ended.
#include "close.h"

struct lanes {
    real field[B_LANE];
    unsigned live; // a bit for each lane
};

static int refill_lone(struct lanes *to, int next, int count, float (*from)[LONE_ROOM]) {
    COUNT(refill_lone, call);
    unsigned ended = ~to->live & ((1u << LANES) - 1);
    int more = __builtin_popcount(ended) - (count - next);
    for (; more > 0; more--)
        ended &= ended - 1;
    if (!ended)
        return next;
    expand_rows(to->field, B_LANE, ended, &from[0][next], LONE_ROOM);
    to->live |= ended;
    return next + __builtin_popcount(ended);
}

struct packet {
    struct vec origin, direction;
    real t, rest, to, had; // t: two floats
    real height, slope;    // of the plane
    mask done, reached, met, close;
};

static inline struct vec fields(const struct lanes *from, int first) {
    return (struct vec){from->field[first], from->field[first + 1], from->field[first + 2]};
}

static inline struct packet packet_of(const struct lanes *from) {
    return (struct packet){fields(from, B_ORIGIN),
                           fields(from, B_DIRECTION),
                           from->field[B_T],
                           from->field[B_MORE],
                           from->field[B_TO],
                           from->field[B_HAD],
                           from->field[B_HEIGHT],
                           from->field[B_SLOPE],
                           lanes_of(~from->live),
                           no_lane(),
                           no_lane(),
                           no_lane()};
}

static inline void advance(struct packet *p, real h, real hit_distance, real most) {
    ACTIVE(LANES - count_of(p->done));
    COUNT(advance, call);
    real height = mul_add(p->t, p->slope, p->height), least = least_of(h, height);
    mask live = not_in(p->done), reached = less_in(live, least, hit_distance);
    real step = keep(live, least + p->rest), t = p->t + step;
    p->rest = choose(live, step - (t - p->t), p->rest);
    p->t = t;
    p->had = add_where(live, p->had, set(1.0f));
    p->reached = either(p->reached, reached);
    p->met = either(p->met, not_less_in(reached, height, h));
    live = but_greater(but_not(reached, live), p->t, p->to);
    live = less_in(live, p->had, most);
    p->close = either(p->close, less_in(live, h, set(CLOSE)));
    p->done = either(not_in(live), p->close);
}

// What has ended is told, what is close waits, and both are no longer live.
static void retire_lone(const struct packet *p, struct lanes *from, real most, struct desk *desk) {
    ACTIVE(count_of(lanes_of(from->live)));
    COUNT(retire_lone, call);
    from->field[B_T] = p->t;
    from->field[B_MORE] = p->rest;
    from->field[B_HAD] = p->had;
    unsigned ended = bits(p->done) & from->live;
    from->live &= ~ended;
    if (!ended)
        return;
    COUNT(retire_lone, ended);
    float t[LANES], rest[LANES], rays[LANES], had[LANES], found[LANES];
    mask close = both(p->close, lanes_of(ended));
    unload(p->t, t);
    unload(p->rest, rest);
    unload(from->field[B_RAY], rays);
    outcome(p->met, p->reached, p->had, most, had, found);
    for (unsigned which = ended & ~bits(close); which; which &= which - 1) {
        int lane = __builtin_ctz(which);
        tell(desk, (int)rays[lane], (double)t[lane] + (double)rest[lane], had[lane], found[lane]);
    }
    if (any(close))
        wait_close(close, from->field[B_RAY], p->t, p->rest, p->had, desk);
}

// A step of all packets. How many lanes have ended.
__attribute__((always_inline)) static inline int
step_lone(const struct placed *s, struct packet *p, bool soon, real hit_distance, real most) {
    struct vec at[ABREAST];
    mask done[ABREAST];
    real h[ABREAST];
    COUNT(step_lone, call);
    for (int k = 0; k < ABREAST; k++) {
        ACTIVE(LANES - count_of(p[k].done));
        COUNT(step_lone, packet);
        at[k] = vec_along(p[k].origin, p[k].direction, p[k].t);
        done[k] = p[k].done;
    }
    bulbs(s, at, done, soon, true, h);
    int ended = 0;
    for (int k = 0; k < ABREAST; k++) {
        advance(&p[k], h[k], hit_distance, most);
        ended += count_of(p[k].done);
    }
    return ended;
}

// The first steps of rays that begin together are much alike, and need few iterations: packets take them as they are,
// until a ray of theirs ends.
static void step_together(const struct placed *s, float (*rays)[LONE_ROOM], int count,
                          real hit_distance, real most) {
    COUNT(step_together, call);
    for (int first = 0; first < count; first += ABREAST * LANES) {
        struct packet p[ABREAST];
        real t[ABREAST], rest[ABREAST], had[ABREAST]; // before the last step
        int before = 0, ended;
        for (int k = 0; k < ABREAST; k++) {
            int from = first + k * LANES, left = count - from;
            left = left < 0 ? 0 : left < LANES ? left : LANES;
            struct lanes lanes = {.live = (1u << left) - 1};
            for (int i = 0; i < B_LANE; i++)
                lanes.field[i] = left ? load(&rays[i][from]) : set(2.0f);
            p[k] = packet_of(&lanes);
            before += count_of(p[k].done);
        }
        do {
            for (int k = 0; k < ABREAST; k++) {
                t[k] = p[k].t;
                rest[k] = p[k].rest;
                had[k] = p[k].had;
            }
            ended = step_lone(s, p, true, hit_distance, most);
        } while (ended == before);
        for (int k = 0; k < ABREAST; k++) {
            int from = first + k * LANES;
            if (from >= count)
                break;
            unload(t[k], &rays[B_T][from]);
            unload(rest[k], &rays[B_MORE][from]);
            unload(had[k], &rays[B_HAD][from]);
        }
    }
}

static void march_floats(const struct placed *s, float (*rays)[LONE_ROOM], int count,
                         real hit_distance, real most, struct desk *desk) {
    COUNT(march_floats, call);
    struct lanes lanes[ABREAST];
    for (int k = 0; k < ABREAST; k++) {
        lanes[k].live = 0;
        for (int i = 0; i < B_LANE; i++) // a point to work on, and nothing comes of it
            lanes[k].field[i] = set(2.0f);
    }
    int next = 0;
    unsigned live;
    do {
        struct packet p[ABREAST];
        int ended = 0;
        for (int k = 0; k < ABREAST; k++) {
            next = refill_lone(&lanes[k], next, count, rays);
            ACTIVE(count_of(lanes_of(lanes[k].live)));
            COUNT(march_floats, packet);
            p[k] = packet_of(&lanes[k]);
            ended += count_of(p[k].done);
        }
        int enough = next < count ? ended + REFILL_LONE : ABREAST * LANES;
        while (ended < enough)
            ended = step_lone(s, p, false, hit_distance, most);
        live = 0;
        for (int k = 0; k < ABREAST; k++) {
            retire_lone(&p[k], &lanes[k], most, desk);
            live |= lanes[k].live;
        }
    } while (next < count || live);
}

void march_lone(struct world *world) {
    COUNT(march_lone, call);
    struct desk *desk = world->desk;
    const struct placed *s = the_one(SHAPE_MANDELBULB, world->scene);
    const struct model *model = &world->scene->model;
    real hit_distance = most_of(set((float)model->march.hit_distance), set(0x1p-24f));
    real most = set((float)step_cap(model));
    desk->close_first = desk->closes = desk->opens = 0;
    step_together(s, desk->lone, desk->lones, hit_distance, most);
    march_floats(s, desk->lone, desk->lones, hit_distance, most, desk);
    struct close_lanes lanes[ABREAST];
    struct pieces pieces = {.next = 0, .count = 0};
    memset(lanes, 0, sizeof lanes);
    for (;;) { // rays may still be in the lanes when some are to be marched in floats
        march_close(s, hit_distance, most, lanes, &pieces, desk);
        if (desk->opens == 0)
            break;
        int opens = desk->opens;
        desk->opens = 0;
        march_floats(s, desk->open, opens, hit_distance, most, desk);
    }
    desk->lones = 0;
}

static inline wide wide_times(wide a, wide b) {
    return (wide){a.low * b.low, a.high * b.high};
}

static inline wide wide_product(struct wide_vec a, struct wide_vec b) {
    return wide_along(wide_along(wide_times(a.x, b.x), a.y, b.y), a.z, b.z);
}

static inline real rest_of(wide a, real near) {
    return narrow((wide){a.low - half_low(near), a.high - half_high(near)});
}

static void pack_wide(mask m, wide a, float (*field)[LONE_ROOM], int more, int at) {
    real near = narrow(a);
    pack(m, near, field[0] + at);
    pack(m, rest_of(a, near), field[more] + at);
}

void gaze_lone(struct vec direction, struct wide_vec exact, mask active, int slot,
               struct world *world) {
    ACTIVE(count_of(active));
    COUNT(gaze_lone, call);
    COUNT(gaze_lone, scalar);
    const struct prepared *scene = world->scene;
    struct desk *desk = world->desk;
    const struct placed *s = the_one(SHAPE_MANDELBULB, scene);
    const struct placed *plane = the_one(SHAPE_PLANE, scene);
    struct wide_vec eye = wide_place(world->eye), from = wide_from(eye, s->centre);
    struct wide_vec o = {wide_dot(from, s->row[0]), wide_dot(from, s->row[1]),
                         wide_dot(from, s->row[2])};
    struct wide_vec d = {wide_dot(exact, s->row[0]), wide_dot(exact, s->row[1]),
                         wide_dot(exact, s->row[2])};
    real zero = set(0.0f), height = set(INFINITY), slope = zero;
    if (plane) {
        COUNT(gaze_lone, plane);
        height = coordinate(plane, wide_from(eye, plane->centre), 0);
        slope = vec_dot(vec_set(plane->normal), direction);
    }
    // To where the ray is nearest to the centre: what is marched is of the shape's size.
    wide way = wide_product(o, d), back = {half_set(0.0) - way.low, half_set(0.0) - way.high};
    struct wide_vec c = {wide_along(o.x, d.x, back), wide_along(o.y, d.y, back),
                         wide_along(o.z, d.z, back)};
    real before = narrow(back);
    real to = root(most_of(set(s->a * s->a) - narrow(wide_product(c, c)), zero));
    mask near = both(both(active, greater(to, zero)), greater(before + to, zero));
    unload(zero, &desk->marched[MARCHED_T][slot]);
    unload(zero, &desk->marched[MARCHED_LAST][slot]);
    unload(zero, &desk->marched[MARCHED_EVALS][slot]);
    unload(set(-1.0f), &desk->marched[MARCHED_FOUND][slot]);
    if (!any(near))
        return;
    ACTIVE(count_of(near));
    COUNT(gaze_lone, near);
    float (*field)[LONE_ROOM] = desk->lone;
    int at = desk->lones;
    const wide values[] = {c.x, c.y, c.z, d.x, d.y, d.z};
    for (int i = 0; i < 6; i++)
        pack_wide(near, values[i], field + i, B_REST, at);
    pack_wide(near, way, field + B_T, 1, at);
    pack_wide(near, back, field + B_BEFORE, 1, at);
    unload(lane_numbers() + set((float)at), field[B_RAY] + at);
    unload(zero, field[B_HAD] + at);
    pack(near, to, field[B_TO] + at);
    pack(near, lane_numbers() + set((float)slot), field[B_SLOT] + at);
    pack(near, mul_add(before, slope, height), field[B_HEIGHT] + at);
    pack(near, slope, field[B_SLOPE] + at);
    desk->lones += count_of(near);
}
