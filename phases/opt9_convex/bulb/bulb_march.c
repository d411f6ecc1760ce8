// Marches of camera and mirror rays to a Mandelbulb. Its estimate is no bound, so what a march finds depends
// on its steps: by the lesser of the estimate and the height over the scene's first plane, from the ray's
// origin. The last digits decide where a ray ends. So t is two floats, and near the surface
// bulb/bulb_chebyshev.c takes over. Packets march in turns, and ended lanes are refilled from the queue.
#include <string.h>

#include "bulb/bulb_chebyshev.h"
#include "bulb/bulb_estimate.h"
#include "bulb/bulb_march.h"
#include "bulb/bulb_steps.h"
#include "types/sdf.h"
#include "types/shading_packet.h"

// With a hit distance of this or more, rays are marched in floats only: the error of 1e-7 does not matter
// then.
#define COARSE_HIT_DISTANCE 1e-4f

#include "simd/bulb_lanes.h"

struct bulb_packet {
    struct vec origin, direction;
    vfloat t, rest, to, born; // t: two floats
    vfloat height, slope;     // of the plane
    vmask done, met, close;
};

static inline struct bulb_packet bulb_packet_of(const struct bulb_lanes *from) {
    return (struct bulb_packet){vec_of_fields(from, B_ORIGIN),
                                vec_of_fields(from, B_DIRECTION),
                                from->field[B_T],
                                from->field[B_T_LOW],
                                from->field[B_TO],
                                from->field[B_STEPS],
                                from->field[B_HEIGHT],
                                from->field[B_SLOPE],
                                v_mask_of_bits(~from->live),
                                v_mask_none(),
                                v_mask_none()};
}

// Moves each ray on. oldest: rays that took their lane before this count have taken all their steps. close:
// estimate below which a ray goes on in bulb/bulb_chebyshev.c.
static inline void advance_bulb(struct bulb_packet *p, vfloat h, vfloat hit_distance, vfloat oldest,
                                vfloat close) {
    p->born =
        v_select(p->done, p->born + v_splat(1.0f), p->born); // a lane that waits takes no step
    vfloat height = v_madd(p->t, p->slope, p->height);
    vmask live = v_not(p->done), reached;
    vfloat way = far_step(live, h, height, hit_distance, close, &reached);
    vfloat step = v_select_or_zero(live, way + p->rest), t = p->t + step;
    p->rest = v_select(live, step - (t - p->t), p->rest);
    p->t = t;
    p->met = v_or(p->met, v_cmp_ge_in(reached, height, h));
    live = v_cmp_ngt_in(v_andnot(reached, live), p->t, p->to);
    live = v_cmp_nge_in(live, oldest, p->born);
    p->close = v_or(p->close, v_cmp_lt_in(live, h, close));
    p->done = v_or(v_not(live), p->close);
}

// Frees the lanes that have ended: hits are stored, close rays are queued.
static void retire_bulb(const struct bulb_packet *p, struct bulb_lanes *from, float steps,
                        struct worker_scratch *scratch) {
    struct vec at = vec_along(p->origin, p->direction, p->t);
    float place[3][LANES], way[LANES], slots[LANES];
    v_store(at.x, place[0]);
    v_store(at.y, place[1]);
    v_store(at.z, place[2]);
    v_store(from->field[B_BEFORE] + p->t, way);
    v_store(from->field[B_SLOT], slots);
    from->field[B_T] = p->t;
    from->field[B_T_LOW] = p->rest;
    from->field[B_STEPS] = p->born;
    unsigned ended = v_mask_bits(p->done) & from->live;
    for (unsigned rest = ended & v_mask_bits(p->met); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest), slot = (int)slots[lane];
        if (way[lane] < scratch->met[slot]) {
            scratch->met[slot] = way[lane];
            scratch->met_shape[slot] = scratch->shape;
            for (int i = 0; i < 3; i++)
                scratch->met_at[i][slot] = place[i][lane];
        }
    }
    vmask close = v_and(p->close, v_mask_of_bits(ended));
    if (v_any(close)) {
        queue_close(close, from->field[B_RAY], p->t, p->rest, v_splat(steps) - from->field[B_STEPS],
                    scratch);
    }
    from->live &= ~ended;
}

// One step of all packets. Returns how many lanes have ended.
__attribute__((always_inline)) static inline int step_bulbs(const struct primitive *s,
                                                            struct bulb_packet *p, bool soon,
                                                            vfloat hit_distance, vfloat oldest,
                                                            vfloat close) {
    struct vec at[INTERLEAVED];
    vmask done[INTERLEAVED];
    vfloat h[INTERLEAVED];
    for (int k = 0; k < INTERLEAVED; k++) {
        at[k] = vec_along(p[k].origin, p[k].direction, p[k].t);
        done[k] = p[k].done;
    }
    bulbs(s, at, done, soon, true, h);
    int ended = 0;
    for (int k = 0; k < INTERLEAVED; k++) {
        advance_bulb(&p[k], h[k], hit_distance, oldest, close);
        ended += v_count(p[k].done);
    }
    return ended;
}

// Takes the first steps of neighbouring rays as whole packets, until a ray of theirs ends: these steps are
// alike and need few iterations.
static void step_first_together(const struct primitive *s, float (*rays)[BULB_ROOM], int count,
                                const struct limits *limits, vfloat hit_distance, float close) {
    for (int first = 0; first < count; first += INTERLEAVED * LANES) {
        struct bulb_packet p[INTERLEAVED];
        vfloat t[INTERLEAVED], rest[INTERLEAVED]; // before the last step
        int before = 0, steps = 0;
        for (int k = 0; k < INTERLEAVED; k++) {
            struct bulb_lanes lanes = bulb_lanes_of(rays, first + k * LANES, count);
            p[k] = bulb_packet_of(&lanes);
            t[k] = p[k].t;
            rest[k] = p[k].rest;
            before += v_count(p[k].done);
        }
        for (; steps < limits->max_steps - 1; steps++) {
            if (step_bulbs(s, p, true, hit_distance, v_splat(-INFINITY), v_splat(close)) > before)
                break;
            for (int k = 0; k < INTERLEAVED; k++) {
                t[k] = p[k].t;
                rest[k] = p[k].rest;
            }
        }
        for (int k = 0; k < INTERLEAVED; k++) {
            int from = first + k * LANES;
            if (from >= count)
                break;
            v_store(t[k], &rays[B_T][from]);
            v_store(rest[k], &rays[B_T_LOW][from]);
            v_store(v_splat((float)steps), &rays[B_STEPS][from]);
        }
    }
}

static void march_floats(const struct primitive *s, float (*rays)[BULB_ROOM], int count,
                         const struct limits *limits, float close, struct worker_scratch *scratch) {
    struct bulb_lanes lanes[INTERLEAVED];
    for (int k = 0; k < INTERLEAVED; k++)
        lanes[k] = bulb_lanes_of(rays, 0, 0);
    float hit = (float)limits->hit_distance;
    vfloat hit_distance = v_splat(hit > 0x1p-24f ? hit : 0x1p-24f);
    float most = (float)limits->max_steps, steps = 0.0f;
    int next = 0;
    unsigned live;
    do {
        struct bulb_packet p[INTERLEAVED];
        int ended = 0;
        for (int k = 0; k < INTERLEAVED; k++) {
            vmask waits = v_mask_of_bits(~lanes[k].live);
            next = refill_bulb(&lanes[k], next, count, rays);
            vmask begins = v_and(waits, v_mask_of_bits(lanes[k].live));
            vfloat had = lanes[k].field[B_STEPS];
            lanes[k].field[B_STEPS] = v_select(begins, v_splat(steps) - had, had);
            p[k] = bulb_packet_of(&lanes[k]);
            ended += v_count(p[k].done);
        }
        int enough = next < count ? ended + REFILL : INTERLEAVED * LANES;
        while (ended < enough && steps < STEPS_COUNTED) {
            steps += 1.0f;
            ended = step_bulbs(s, p, false, hit_distance, v_splat(steps - most), v_splat(close));
        }
        live = 0;
        for (int k = 0; k < INTERLEAVED; k++) {
            retire_bulb(&p[k], &lanes[k], steps, scratch);
            live |= lanes[k].live;
        }
        if (!(steps < STEPS_COUNTED)) {
            for (int k = 0; k < INTERLEAVED; k++)
                lanes[k].field[B_STEPS] = lanes[k].field[B_STEPS] - v_splat(steps);
            steps = 0.0f;
        }
    } while (next < count || live);
}

void march_bulb(const struct primitive *s, int count, const struct limits *limits,
                struct worker_scratch *scratch) {
    scratch->shape = s->index;
    bool coarse = !((float)limits->hit_distance < COARSE_HIT_DISTANCE);
    float close = coarse ? -INFINITY : CLOSE_ESTIMATE;
    float hit = (float)limits->hit_distance;
    step_first_together(s, scratch->bulb, count, limits, v_splat(hit > 0x1p-24f ? hit : 0x1p-24f),
                        close);
    march_floats(s, scratch->bulb, count, limits, close, scratch);
    if (coarse)
        return;
    struct chebyshev_lanes lanes[INTERLEAVED];
    struct ray_pieces pieces = {.next = 0, .count = 0};
    memset(lanes, 0, sizeof lanes);
    float steps = 0.0f;
    for (;;) {
        march_chebyshev(s, limits, lanes, &pieces, &steps, scratch);
        if (scratch->open_count == 0)
            break;
        int opens = scratch->open_count;
        scratch->open_count = 0;
        march_floats(s, scratch->open, opens, limits, CLOSE_ESTIMATE, scratch);
    }
    scratch->close_count = scratch->close_first = 0;
}

int queue_bulb_rays(int count, const struct primitive *s, struct vec_double o, struct vec_double d,
                    const struct packet_ray *ray, vfloat end, int slot,
                    const struct prepared *scene, struct worker_scratch *scratch) {
    vfloat height = v_splat(INFINITY), slope = v_splat(0.0f);
    if (KNOWN(scene)->plane >= 0) {
        const struct primitive *plane = &KNOWN(scene)->primitives[KNOWN(scene)->plane];
        height = height_over(plane, ray->origin);
        slope = add_dot(plane->normal, ray->direction);
    }
    // Subtracts `before`, the distance to the point nearest to the centre: the rest is of the shape's size.
    vdouble way = v_double_product(o, d),
            back = {v_half_splat(0.0) - way.low, v_half_splat(0.0) - way.high};
    struct vec_double c = {v_double_along(o.x, d.x, back), v_double_along(o.y, d.y, back),
                           v_double_along(o.z, d.z, back)};
    vfloat zero = v_splat(0.0f), before = v_double_to_float(back);
    vfloat half =
        v_sqrt(v_max(v_splat(s->bound_sq) - v_double_to_float(v_double_product(c, c)), zero));
    vfloat to = v_min(before + half, end);
    vmask near = v_and(v_and(ray->active, v_cmp_gt(half, zero)),
                       v_and(v_cmp_lt(before - half, to), v_cmp_gt(to, zero)));
    if (!v_any(near))
        return count;
    float (*field)[BULB_ROOM] = scratch->bulb;
    pack_bulb_rays(near, c, d, field, count);
    vfloat t = v_double_to_float(way);
    vfloat rest = v_double_residual(way, t);
    start_at(&t, &rest, -half);
    v_compress_store(near, t, field[B_T] + count);
    v_compress_store(near, rest, field[B_T_LOW] + count);
    v_store(v_iota() + v_splat((float)count), field[B_RAY] + count);
    v_store(v_splat(0.0f), field[B_STEPS] + count);
    v_compress_store(near, to - before, field[B_TO] + count);
    v_compress_store(near, v_iota() + v_splat((float)slot), field[B_SLOT] + count);
    v_compress_store(near, before, field[B_BEFORE] + count);
    v_compress_store(near, v_madd(before, slope, height), field[B_HEIGHT] + count);
    v_compress_store(near, slope, field[B_SLOPE] + count);
    return count + v_count(near);
}

void take_bulb_hits(struct shading_packet *at, int slot, const struct worker_scratch *scratch) {
    vfloat t = v_load(scratch->met + slot), shape = v_load(scratch->met_shape + slot);
    vmask met = v_and(at->ray.active, v_cmp_lt(t, at->hit.t));
    if (!v_any(met))
        return;
    struct vec local = {v_load(scratch->met_at[0] + slot), v_load(scratch->met_at[1] + slot),
                        v_load(scratch->met_at[2] + slot)};
    at->hit.found = v_or(at->hit.found, met);
    at->hit.t = v_select(met, t, at->hit.t);
    at->hit.shape = v_select(met, shape, at->hit.shape);
    at->hit.local = vec_select(met, local, at->hit.local);
}

void clear_bulb_hits(struct worker_scratch *scratch, int slots) {
    for (int i = 0; i < slots; i += LANES) {
        v_store(v_splat(INFINITY), scratch->met + i);
        v_store(v_splat(-1.0f), scratch->met_shape + i);
    }
}

static struct vec_double to_doubles(struct vec v) {
    vfloat zero = v_splat(0.0f);
    return (struct vec_double){v_double_sum(v.x, zero), v_double_sum(v.y, zero),
                               v_double_sum(v.z, zero)};
}

INLINE void march_to_bulb(int i, const struct shading_packet *stage, int packets,
                          const struct tile_context *work) {
    const struct primitive *s = &KNOWN(work->scene)->primitives[i];
    if (s->type != SHAPE_MANDELBULB)
        return;
    int count = 0;
    for (int k = 0; k < packets; k++)
        count = queue_bulb_rays(count, s, to_doubles(to_local(s, stage[k].ray.origin)),
                                to_doubles(turned(s, stage[k].ray.direction)), &stage[k].ray,
                                stage[k].hit.t, k * LANES, work->scene, work->scratch);
    march_bulb(s, count, &work->scene->model.march, work->scratch);
}

void hit_bulbs(struct shading_packet *stage, int packets, const struct tile_context *work) {
    clear_bulb_hits(work->scratch, packets * LANES);
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
        march_to_bulb(i, stage, packets, work);
    for (int k = 0; k < packets; k++)
        take_bulb_hits(&stage[k], k * LANES, work->scratch);
}
