// Camera and mirror rays through a Mandelbulb. Its estimate is no bound: a march leaps over what is thin, and what
// it finds depends on its steps. So these are the steps of a march from the ray's origin by the least of the
// estimate and the distance to the scene's plane, as in every phase; rays that miss the bounding sphere take none.
// Two packets by turns, whose lanes are filled again from the rays
// that wait as soon as enough of them have ended.
#include "bulb.h"
#include "stage.h"

#include <stdalign.h>

enum { REFILL = LANES / 4 }; // ended lanes

struct lanes {
    alignas(64) float field[B_FIELDS][LANES];
    unsigned live; // a bit for each lane
};

static int refill(struct lanes *to, int next, int count, const struct desk *desk) {
    for (unsigned ended = ~to->live & ((1u << LANES) - 1); ended && next < count;
         ended &= ended - 1, next++) {
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
    ACTIVE(LANES - count_of(p->done));
    COUNT(advance, call);
    real height = mul_add(p->t, p->slope, p->height);
    mask reached = but_not(p->done, less(least_of(h, height), hit_distance));
    p->t = p->t + drop(p->done, least_of(h, height));
    p->met = either(p->met, both(reached, not_less(height, h)));
    p->done = either(p->done, either(reached, greater(p->t, p->to)));
}

// What has ended gives its answer and is no longer live.
static void retire(const struct packet *p, struct lanes *from, struct desk *desk) {
    COUNT(retire, call);
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
    COUNT(march_bulb, call);
    desk->shape = s->index;
    struct lanes lanes[ABREAST];
    for (int k = 0; k < ABREAST; k++) {
        lanes[k].live = 0;
        for (int i = 0; i < B_FIELDS; i++) // a point to work on, and nothing comes of it
            unload(set(2.0f), lanes[k].field[i]);
    }
    // Finer than float tells points of its size apart no march can go.
    real hit_distance =
        set(limits->hit_distance > 0x1p-22 ? (float)limits->hit_distance : 0x1p-22f);
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
            COUNT(march_bulb, step);
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

int gather_bulb(int count, const struct placed *s, struct vec o, const struct ray *ray, real end,
                int slot, const struct prepared *scene, struct desk *desk) {
    ACTIVE(count_of(ray->active));
    COUNT(gather_bulb, call);
    struct vec d = turned(s, ray->direction);
    mask active = ray->active;
    real height = set(INFINITY), slope = set(0.0f);
    if (scene->plane >= 0) {
        COUNT(gather_bulb, plane);
        const struct placed *plane = &scene->placed[scene->plane];
        height = height_over(plane, ray->origin);
        slope = vec_dot(vec_set(plane->normal), ray->direction);
    }
    real zero = set(0.0f), before = zero - vec_dot(o, d);
    struct vec c = vec_along(o, d, before);
    real square = vec_dot(c, c), half = root(most_of(set(s->bound_sq) - square, zero));
    // `before`, the way to where the ray is nearest to the centre, is taken off: what is left is exact.
    real to = least_of(before + half, end);
    mask near = both(both(active, less(square, set(s->bound_sq))),
                     both(less(before - half, to), greater(to, zero)));
    if (!any(near))
        return count;
    ACTIVE(count_of(near));
    COUNT(gather_bulb, near);
    float (*field)[BULB_ROOM] = desk->bulb;
    const real values[B_FIELDS] = {c.x,
                                   c.y,
                                   c.z,
                                   d.x,
                                   d.y,
                                   d.z,
                                   zero - before,
                                   to - before,
                                   lane_numbers() + set((float)slot),
                                   before,
                                   mul_add(before, slope, height),
                                   slope};
    for (int i = 0; i < B_FIELDS; i++)
        pack(near, values[i], field[i] + count);
    return count + count_of(near);
}

void take_bulb(struct stage *at, const struct eye *eyes, int slot, const struct convex *work) {
    const struct desk *desk = work->desk;
    real t = load(desk->met + slot), shape = load(desk->met_shape + slot);
    mask met = both(at->ray.active, less(t, at->hit.t));
    ACTIVE(count_of(met));
    COUNT(take_bulb, call);
    if (!any(met))
        return;
    at->hit.found = either(at->hit.found, met);
    at->hit.t = choose(met, t, at->hit.t);
    at->hit.shape = choose(met, shape, at->hit.shape);
    for (int i = 0; i < work->scene->model.shape_count; i++) {
        const struct placed *s = &work->scene->placed[i];
        COUNT(take_bulb, shape);
        mask here = both(met, same_shape(shape, i));
        if (s->type != SHAPE_MANDELBULB || !any(here))
            continue;
        COUNT(take_bulb, here);
        if (!eyes)
            COUNT(take_bulb, framed);
        struct vec o = eyes ? vec_set(eyes[i].at) : in_frame(s, at->ray.origin),
                   d = turned(s, at->ray.direction);
        real before = set(0.0f) - vec_dot(o, d);
        at->hit.local =
            vec_choose(here, vec_along(vec_along(o, d, before), d, t - before), at->hit.local);
    }
}

void clear_met(struct desk *desk, int slots) {
    for (int i = 0; i < slots; i += LANES) {
        unload(set(INFINITY), desk->met + i);
        unload(set(-1.0f), desk->met_shape + i);
    }
}

void meet_bulbs(struct stage *stage, int packets, const struct convex *work) {
    const struct prepared *scene = work->scene;
    clear_met(work->desk, packets * LANES);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct placed *s = &scene->placed[i];
        if (s->type != SHAPE_MANDELBULB)
            continue;
        int count = 0;
        for (int k = 0; k < packets; k++)
            count = gather_bulb(count, s, in_frame(s, stage[k].ray.origin), &stage[k].ray,
                                stage[k].hit.t, k * LANES, scene, work->desk);
        march_bulb(s, count, &scene->model.march, work->desk);
    }
    for (int k = 0; k < packets; k++)
        take_bulb(&stage[k], NULL, k * LANES, work);
}
