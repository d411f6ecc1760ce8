// Camera and mirror rays through a Mandelbulb. Its estimate is no bound: a march leaps over what is thin, and what
// it finds depends on its steps. So these are the steps of a march from the ray's origin by the least of the
// estimate and the distance to the scene's first plane, and to no other shape (NOTES, "Beside other
// shapes"); rays that miss the bounding sphere take none.
// Where a march ends hangs on the last digits of its steps: t is two floats, and near the surface close.h tells them.
// Packets by turns, whose lanes are filled again from the rays that wait as soon as enough of them have ended.
#include "close.h"

// Rays that end that far from the surface are marched in floats: what they err by, 1e-7, is no share of their steps.
#define COARSE 1e-4f

struct lanes {
    real field[B_LANE];
    unsigned live; // a bit for each lane
};

static int refill_bulb(struct lanes *to, int next, int count, float steps,
                       float (*from)[BULB_ROOM]) {
    COUNT(refill_bulb, call);
    unsigned ended = ~to->live & ((1u << LANES) - 1);
    int more = __builtin_popcount(ended) - (count - next);
    for (; more > 0; more--)
        ended &= ended - 1;
    if (!ended)
        return next;
    ACTIVE(__builtin_popcount(ended));
    COUNT(refill_bulb, taken);
    expand_rows(to->field, B_LANE, ended, &from[0][next], BULB_ROOM);
    to->field[B_BORN] = choose(lanes_of(ended), set(steps) - to->field[B_BORN], to->field[B_BORN]);
    to->live |= ended;
    return next + __builtin_popcount(ended);
}

struct packet {
    struct vec origin, direction;
    real t, rest, to, born; // t: two floats
    real height, slope;     // of the plane
    mask done, met, close;
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
                           from->field[B_BORN],
                           from->field[B_HEIGHT],
                           from->field[B_SLOPE],
                           lanes_of(~from->live),
                           no_lane(),
                           no_lane()};
}

// `oldest`: rays that old have had their steps. close: of such an estimate a ray goes on in close.h.
static inline void advance(struct packet *p, real h, real hit_distance, real oldest, real close) {
    ACTIVE(LANES - count_of(p->done));
    COUNT(advance, call);
    p->born = choose(p->done, p->born + set(1.0f), p->born); // waiting for others is no step
    real height = mul_add(p->t, p->slope, p->height), least = least_of(h, height);
    mask live = not_in(p->done), reached = less_in(live, least, hit_distance);
    real step = keep(live, least + p->rest), t = p->t + step;
    p->rest = choose(live, step - (t - p->t), p->rest);
    p->t = t;
    p->met = either(p->met, not_less_in(reached, height, h));
    live = but_greater(but_not(reached, live), p->t, p->to);
    live = but_not_less(live, oldest, p->born);
    p->close = either(p->close, less_in(live, h, close));
    p->done = either(not_in(live), p->close);
}

// What has ended gives its answer, what is close waits, and both are no longer live.
static void retire_bulb(const struct packet *p, struct lanes *from, float steps,
                        struct desk *desk) {
    ACTIVE(count_of(lanes_of(from->live)));
    COUNT(retire_bulb, call);
    struct vec at = vec_along(p->origin, p->direction, p->t);
    float place[3][LANES], way[LANES], slots[LANES];
    unload(at.x, place[0]);
    unload(at.y, place[1]);
    unload(at.z, place[2]);
    unload(from->field[B_BEFORE] + p->t, way);
    unload(from->field[B_SLOT], slots);
    from->field[B_T] = p->t;
    from->field[B_MORE] = p->rest;
    from->field[B_BORN] = p->born;
    unsigned ended = bits(p->done) & from->live;
    for (unsigned rest = ended & bits(p->met); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest), slot = (int)slots[lane];
        if (way[lane] < desk->met[slot]) {
            desk->met[slot] = way[lane];
            desk->met_shape[slot] = desk->shape;
            for (int i = 0; i < 3; i++)
                desk->met_at[i][slot] = place[i][lane];
        }
    }
    mask close = both(p->close, lanes_of(ended));
    if (any(close)) {
        COUNT(retire_bulb, close);
        wait_close(close, from->field[B_RAY], p->t, p->rest, set(steps) - from->field[B_BORN],
                   desk);
    }
    from->live &= ~ended;
}

// A step of all packets. How many lanes have ended.
__attribute__((always_inline)) static inline int step_bulbs(const struct placed *s,
                                                            struct packet *p, bool soon,
                                                            real hit_distance, real oldest,
                                                            real close) {
    struct vec at[ABREAST];
    mask done[ABREAST];
    real h[ABREAST];
    COUNT(step_bulbs, call);
    for (int k = 0; k < ABREAST; k++) {
        ACTIVE(LANES - count_of(p[k].done));
        COUNT(step_bulbs, packet);
        at[k] = vec_along(p[k].origin, p[k].direction, p[k].t);
        done[k] = p[k].done;
    }
    bulbs(s, at, done, soon, true, h);
    int ended = 0;
    for (int k = 0; k < ABREAST; k++) {
        advance(&p[k], h[k], hit_distance, oldest, close);
        ended += count_of(p[k].done);
    }
    return ended;
}

// The first steps of rays that begin together are much alike, and need few iterations: packets take them as they are,
// until a ray of theirs ends.
static void step_together(const struct placed *s, float (*rays)[BULB_ROOM], int count,
                          const struct limits *limits, real hit_distance, float close) {
    COUNT(step_together, call);
    for (int first = 0; first < count; first += ABREAST * LANES) {
        struct packet p[ABREAST];
        real t[ABREAST], rest[ABREAST]; // before the last step
        int before = 0, steps = 0;
        for (int k = 0; k < ABREAST; k++) {
            int from = first + k * LANES, left = count - from;
            left = left < 0 ? 0 : left < LANES ? left : LANES;
            struct lanes lanes = {.live = (1u << left) - 1};
            for (int i = 0; i < B_LANE; i++)
                lanes.field[i] = left ? load(&rays[i][from]) : set(2.0f);
            p[k] = packet_of(&lanes);
            t[k] = p[k].t;
            rest[k] = p[k].rest;
            before += count_of(p[k].done);
        }
        for (; steps < limits->max_steps - 1; steps++) {
            if (step_bulbs(s, p, true, hit_distance, set(-INFINITY), set(close)) > before)
                break;
            for (int k = 0; k < ABREAST; k++) {
                t[k] = p[k].t;
                rest[k] = p[k].rest;
            }
        }
        for (int k = 0; k < ABREAST; k++) {
            int from = first + k * LANES;
            if (from >= count)
                break;
            unload(t[k], &rays[B_T][from]);
            unload(rest[k], &rays[B_MORE][from]);
            unload(set((float)steps), &rays[B_BORN][from]);
        }
    }
}

static void march_floats(const struct placed *s, float (*rays)[BULB_ROOM], int count,
                         const struct limits *limits, float close, struct desk *desk) {
    COUNT(march_floats, call);
    struct lanes lanes[ABREAST];
    for (int k = 0; k < ABREAST; k++) {
        lanes[k].live = 0;
        for (int i = 0; i < B_LANE; i++) // a point to work on, and nothing comes of it
            lanes[k].field[i] = set(2.0f);
    }
    float hit = (float)limits->hit_distance;
    real hit_distance = set(hit > 0x1p-24f ? hit : 0x1p-24f);
    float most = (float)limits->max_steps, steps = 0.0f;
    int next = 0;
    unsigned live;
    do {
        struct packet p[ABREAST];
        int ended = 0;
        for (int k = 0; k < ABREAST; k++) {
            next = refill_bulb(&lanes[k], next, count, steps, rays);
            ACTIVE(count_of(lanes_of(lanes[k].live)));
            COUNT(march_floats, packet);
            p[k] = packet_of(&lanes[k]);
            ended += count_of(p[k].done);
        }
        int enough = next < count ? ended + REFILL : ABREAST * LANES;
        while (ended < enough && steps < STEPS_COUNTED) {
            COUNT(march_floats, step);
            steps += 1.0f;
            ended = step_bulbs(s, p, false, hit_distance, set(steps - most), set(close));
        }
        live = 0;
        for (int k = 0; k < ABREAST; k++) {
            retire_bulb(&p[k], &lanes[k], steps, desk);
            live |= lanes[k].live;
        }
        if (!(steps < STEPS_COUNTED)) {
            for (int k = 0; k < ABREAST; k++)
                lanes[k].field[B_BORN] = lanes[k].field[B_BORN] - set(steps);
            steps = 0.0f;
        }
    } while (next < count || live);
}

void march_bulb(const struct placed *s, int count, const struct limits *limits, struct desk *desk) {
    COUNT(march_bulb, call);
    desk->shape = s->index;
    bool coarse = !((float)limits->hit_distance < COARSE);
    float close = coarse ? 0.0f : CLOSE;
    float hit = (float)limits->hit_distance;
    step_together(s, desk->bulb, count, limits, set(hit > 0x1p-24f ? hit : 0x1p-24f), close);
    march_floats(s, desk->bulb, count, limits, close, desk);
    if (coarse)
        return;
    struct close_lanes lanes[ABREAST];
    struct pieces pieces = {.next = 0, .count = 0};
    memset(lanes, 0, sizeof lanes);
    float steps = 0.0f;
    for (;;) {
        march_close(s, limits, lanes, &pieces, &steps, desk);
        if (desk->opens == 0)
            break;
        int opens = desk->opens;
        desk->opens = 0;
        march_floats(s, desk->open, opens, limits, CLOSE, desk);
    }
    desk->closes = desk->close_first = 0;
}

static inline wide wide_times(wide a, wide b) {
    return (wide){a.low * b.low, a.high * b.high};
}

static inline wide wide_product(struct wide_vec a, struct wide_vec b) {
    return wide_along(wide_along(wide_times(a.x, b.x), a.y, b.y), a.z, b.z);
}

static void pack_wide(mask m, wide a, float (*field)[BULB_ROOM], int at) {
    real near = narrow(a);
    pack(m, near, field[0] + at);
    pack(m, narrow((wide){a.low - half_low(near), a.high - half_high(near)}), field[B_REST] + at);
}

int gather_bulb(int count, const struct placed *s, struct wide_vec o, struct wide_vec d,
                const struct ray *ray, real end, int slot, const struct prepared *scene,
                struct desk *desk) {
    ACTIVE(count_of(ray->active));
    COUNT(gather_bulb, call);
    real height = set(INFINITY), slope = set(0.0f);
    if (KNOWN(scene)->plane >= 0) {
        COUNT(gather_bulb, plane);
        const struct placed *plane = &KNOWN(scene)->placed[KNOWN(scene)->plane];
        height = height_over(plane, ray->origin);
        slope = dot_with(plane->normal, ray->direction);
    }
    // `before`, the way to where the ray is nearest to the centre, is taken off: the rest is of the shape's size.
    wide way = wide_product(o, d), back = {half_set(0.0) - way.low, half_set(0.0) - way.high};
    struct wide_vec c = {wide_along(o.x, d.x, back), wide_along(o.y, d.y, back),
                         wide_along(o.z, d.z, back)};
    real zero = set(0.0f), before = narrow(back);
    real half = root(most_of(set(s->bound_sq) - narrow(wide_product(c, c)), zero));
    real to = least_of(before + half, end);
    mask near = both(both(ray->active, greater(half, zero)),
                     both(less(before - half, to), greater(to, zero)));
    if (!any(near))
        return count;
    ACTIVE(count_of(near));
    COUNT(gather_bulb, near);
    float (*field)[BULB_ROOM] = desk->bulb;
    const wide values[] = {c.x, c.y, c.z, d.x, d.y, d.z};
    for (int i = 0; i < 6; i++)
        pack_wide(near, values[i], field + i, count);
    real t = narrow(way);
    pack(near, t, field[B_T] + count);
    pack(near, narrow((wide){way.low - half_low(t), way.high - half_high(t)}),
         field[B_MORE] + count);
    unload(lane_numbers() + set((float)count), field[B_RAY] + count);
    unload(set(0.0f), field[B_BORN] + count);
    pack(near, to - before, field[B_TO] + count);
    pack(near, lane_numbers() + set((float)slot), field[B_SLOT] + count);
    pack(near, before, field[B_BEFORE] + count);
    pack(near, mul_add(before, slope, height), field[B_HEIGHT] + count);
    pack(near, slope, field[B_SLOPE] + count);
    return count + count_of(near);
}

void take_bulb(struct stage *at, int slot, const struct desk *desk) {
    ACTIVE(count_of(at->ray.active));
    COUNT(take_bulb, call);
    real t = load(desk->met + slot), shape = load(desk->met_shape + slot);
    mask met = both(at->ray.active, less(t, at->hit.t));
    if (!any(met))
        return;
    struct vec local = {load(desk->met_at[0] + slot), load(desk->met_at[1] + slot),
                        load(desk->met_at[2] + slot)};
    at->hit.found = either(at->hit.found, met);
    at->hit.t = choose(met, t, at->hit.t);
    at->hit.shape = choose(met, shape, at->hit.shape);
    at->hit.local = vec_choose(met, local, at->hit.local);
}

void clear_met(struct desk *desk, int slots) {
    for (int i = 0; i < slots; i += LANES) {
        unload(set(INFINITY), desk->met + i);
        unload(set(-1.0f), desk->met_shape + i);
    }
}

static struct wide_vec widened(struct vec v) {
    real zero = set(0.0f);
    return (struct wide_vec){wide_sum(v.x, zero), wide_sum(v.y, zero), wide_sum(v.z, zero)};
}

INLINE void meet_bulb(int i, const struct stage *stage, int packets, const struct convex *work) {
    const struct placed *s = &KNOWN(work->scene)->placed[i];
    if (s->type != SHAPE_MANDELBULB)
        return;
    int count = 0;
    for (int k = 0; k < packets; k++)
        count = gather_bulb(count, s, widened(in_frame(s, stage[k].ray.origin)),
                            widened(turned(s, stage[k].ray.direction)), &stage[k].ray,
                            stage[k].hit.t, k * LANES, work->scene, work->desk);
    march_bulb(s, count, &work->scene->model.march, work->desk);
}

void meet_bulbs(struct stage *stage, int packets, const struct convex *work) {
    clear_met(work->desk, packets * LANES);
    EACH_SHAPE(work->scene, meet_bulb, stage, packets, work);
    for (int k = 0; k < packets; k++)
        take_bulb(&stage[k], k * LANES, work->desk);
}
