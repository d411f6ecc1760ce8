// Camera rays of a scene with one Mandelbulb and at most a plane. Their steps are those of a march from the camera by
// the smaller of the estimate and the plane's distance. Rays that miss the bounding sphere take no steps. Rays that
// have passed the sphere, or reached the plane, go on in march/ray_march.c.
//
// Where a march ends depends on the last digits of its steps. So t is the sum of two floats, and but for the first
// steps the map's first iteration is in doubles. Packets step by turns. Lanes are refilled from the rays that wait as
// soon as enough of them have ended.
#include "bulb/bulb_estimate.h"
#include "core/ray_queues.h"
#include "core/shape_distances.h"
#include "core/trace_context.h"
#include "march/march_step.h"

#define CLOSE_ESTIMATE 5e-3f // no step in floats is nearer to the surface

enum { REFILL_BULB_SINGLE = LANES * LANES / 32 }; // ended lanes

#include "simd/bulb_lanes.h"

struct bulb_packet {
    struct vec origin, direction;
    struct vec_double wide_origin, wide_direction;
    vfloat t, t_lo, end, evals; // t is the sum of two floats
    vfloat height, slope;       // of the plane
    vmask done, reached, met;
};

static inline vdouble wide_field(const struct bulb_lanes *from, int i) {
    return v_double_sum(from->field[i], from->field[B_LOW + i]);
}

static inline struct bulb_packet bulb_packet_of(const struct bulb_lanes *from) {
    return (struct bulb_packet){vec_of_fields(from, B_ORIGIN),
                                vec_of_fields(from, B_DIRECTION),
                                {wide_field(from, 0), wide_field(from, 1), wide_field(from, 2)},
                                {wide_field(from, 3), wide_field(from, 4), wide_field(from, 5)},
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

static inline void advance_bulb(struct bulb_packet *p, vfloat h, vfloat hit_distance, vfloat cap) {
    vfloat height = v_madd(p->t, p->slope, p->height), least = v_min(h, height);
    vmask live = v_not(p->done), reached = v_cmp_lt_in(live, least, hit_distance);
    vfloat step = v_select_or_zero(live, least + p->t_lo), t = p->t + step;
    p->t_lo = v_select(live, step - (t - p->t), p->t_lo);
    p->t = t;
    p->evals = v_add_where(live, p->evals, v_splat(1.0f));
    p->reached = v_or(p->reached, reached);
    p->met = v_or(p->met, v_cmp_nlt_in(reached, height, h));
    live = v_cmp_ngt_in(v_andnot(reached, live), p->t, p->end);
    p->done = v_not(v_cmp_lt_in(live, p->evals, cap));
}

// Stores the results of ended rays for resume_march(), and frees their lanes. A ray at the plane evaluates its last
// step again. One that marches on may have come below the plane by its last step, and so be behind the camera.
static void retire_single(const struct bulb_packet *p, struct bulb_lanes *from, vfloat cap,
                          struct ray_queues *queues) {
    from->field[B_T] = p->t;
    from->field[B_T_LOW] = p->t_lo;
    from->field[B_STEPS] = p->evals;
    unsigned ended = v_mask_bits(p->done) & from->live;
    from->live &= ~ended;
    if (!ended)
        return;
    float t[LANES], t_lo[LANES], rays[LANES], evals[LANES], found[LANES];
    vmask capped = v_andnot(p->reached, v_cmp_ge(p->evals, cap)),
          plane = v_andnot(p->met, p->reached);
    v_store(p->t, t);
    v_store(p->t_lo, t_lo);
    v_store(from->field[B_RAY], rays);
    v_store(p->evals - v_select_or_zero(plane, v_splat(1.0f)), evals);
    v_store(v_select(p->met, v_splat(1.0f), v_select(capped, v_splat(0.0f), v_splat(-1.0f))),
            found);
    for (; ended; ended &= ended - 1) {
        int lane = __builtin_ctz(ended), ray = (int)rays[lane];
        int slot = (int)queues->bulb[B_SLOT][ray];
        double all =
            ((double)queues->bulb[B_BEFORE][ray] + (double)queues->bulb[B_BEFORE_LO][ray]) +
            ((double)t[lane] + (double)t_lo[lane]);
        float far = (float)all;
        bool goes_on = found[lane] < 0 && far < 0;
        queues->marched[MARCH_T][slot] = goes_on ? 0 : far;
        queues->marched[MARCH_LAST_STEP][slot] = (float)(all - (double)far);
        queues->marched[MARCH_EVALS][slot] = evals[lane];
        queues->marched[MARCH_FOUND][slot] = found[lane];
    }
}

// Takes the first iteration in doubles. The derivative only scales a step, and is in floats.
static inline void first_iteration(struct scaled_orbit *b, const struct bulb_packet *p,
                                   vfloat bailout) {
    ACTIVE(v_count(b->on));
    COUNT(bulb_step, call);
    const struct vec_double *o = &p->wide_origin, *d = &p->wide_direction;
    vdouble t = v_double_sum(p->t, p->t_lo), x = v_double_along(o->x, d->x, t);
    vdouble y = v_double_along(o->y, d->y, t), z = v_double_along(o->z, d->z, t);
    struct orbit_double low = bulb_first(x.low, y.low, z.low);
    struct orbit_double high = bulb_first(x.high, y.high, z.high);
    b->x = v_double_to_float((vdouble){low.x, high.x});
    b->y = v_double_to_float((vdouble){low.y, high.y});
    b->z = v_double_to_float((vdouble){low.z, high.z});
    first_slope(b, true);
    bulb_grow(b, bailout);
}

// Takes a step of all packets. Returns how many lanes have ended, or unless `wide` are close.
__attribute__((always_inline)) static inline int step_single(const struct primitive *s,
                                                             struct bulb_packet *p, bool wide,
                                                             vfloat hit_distance, vfloat cap) {
    struct scaled_orbit b[INTERLEAVED];
    struct vec at[INTERLEAVED];
    vfloat h[INTERLEAVED];
    for (int k = 0; k < INTERLEAVED; k++) {
        at[k] = vec_along(p[k].origin, p[k].direction, p[k].t);
        bulb_begin(&b[k], at[k], v_not(p[k].done));
        if (wide)
            first_iteration(&b[k], &p[k], v_splat(s->bailout));
    }
    bulbs_end(s, wide, !wide, true, false, INTERLEAVED, b, at, h);
    int ended = 0;
    for (int k = 0; k < INTERLEAVED; k++) {
        advance_bulb(&p[k], h[k], hit_distance, cap);
        if (!wide)
            p[k].done = v_or(p[k].done, v_cmp_lt(h[k], v_splat(CLOSE_ESTIMATE)));
        ended += v_count(p[k].done);
    }
    return ended;
}

// Takes the first steps of rays, whole packets at a time, until a ray of a packet ends or is close. These steps are
// alike and need few iterations.
static void step_first_together(const struct primitive *s, float (*rays)[BULB_ROOM], int count,
                                vfloat hit_distance, vfloat cap) {
    for (int first = 0; first < count; first += INTERLEAVED * LANES) {
        struct bulb_packet p[INTERLEAVED];
        vfloat t[INTERLEAVED], t_lo[INTERLEAVED], evals[INTERLEAVED]; // before the last step
        int before = 0, ended;
        for (int k = 0; k < INTERLEAVED; k++) {
            struct bulb_lanes lanes = bulb_lanes_of(rays, first + k * LANES, count);
            p[k] = bulb_packet_of(&lanes);
            before += v_count(p[k].done);
        }
        do {
            for (int k = 0; k < INTERLEAVED; k++) {
                t[k] = p[k].t;
                t_lo[k] = p[k].t_lo;
                evals[k] = p[k].evals;
            }
            ended = step_single(s, p, false, hit_distance, cap);
        } while (ended == before);
        for (int k = 0; k < INTERLEAVED; k++) {
            int from = first + k * LANES;
            if (from >= count)
                break;
            v_store(t[k], &rays[B_T][from]);
            v_store(t_lo[k], &rays[B_T_LOW][from]);
            v_store(evals[k], &rays[B_STEPS][from]);
        }
    }
}

static void march_to_ends(const struct primitive *s, int count, vfloat hit_distance, vfloat cap,
                          struct ray_queues *queues) {
    struct bulb_lanes lanes[INTERLEAVED];
    for (int k = 0; k < INTERLEAVED; k++)
        lanes[k] = bulb_lanes_of(queues->bulb, 0, 0);
    int next = 0;
    unsigned live;
    do {
        struct bulb_packet p[INTERLEAVED];
        int ended = 0;
        for (int k = 0; k < INTERLEAVED; k++) {
            next = refill_bulb(&lanes[k], next, count, queues->bulb);
            p[k] = bulb_packet_of(&lanes[k]);
            ended += v_count(p[k].done);
        }
        int enough = next < count ? ended + REFILL_BULB_SINGLE : INTERLEAVED * LANES;
        while (ended < enough)
            ended = step_single(s, p, true, hit_distance, cap);
        live = 0;
        for (int k = 0; k < INTERLEAVED; k++) {
            retire_single(&p[k], &lanes[k], cap, queues);
            live |= lanes[k].live;
        }
    } while (next < count || live);
}

void march_single_bulb(struct trace_context *world) {
    struct ray_queues *queues = world->queues;
    const struct primitive *s = single_shape(SHAPE_MANDELBULB, world->scene);
    const struct model *model = &world->scene->model;
    vfloat hit_distance = v_max(v_splat((float)model->march.hit_distance), v_splat(0x1p-24f));
    vfloat cap = v_splat((float)step_cap(model));
    step_first_together(s, queues->bulb, queues->single_count, hit_distance, cap);
    march_to_ends(s, queues->single_count, hit_distance, cap, queues);
    queues->single_count = 0;
}

void queue_camera_rays_single(struct vec direction, struct vec_double exact, vmask active, int slot,
                              struct trace_context *world) {
    const struct prepared *scene = world->scene;
    struct ray_queues *queues = world->queues;
    const struct primitive *s = single_shape(SHAPE_MANDELBULB, scene);
    const struct primitive *plane = single_shape(SHAPE_PLANE, scene);
    struct vec_double eye = vec_double_of(world->eye), from = vec_double_sub(eye, s->centre);
    struct vec_double o = {v_double_dot(from, s->row[0]), v_double_dot(from, s->row[1]),
                           v_double_dot(from, s->row[2])};
    struct vec_double d = {v_double_dot(exact, s->row[0]), v_double_dot(exact, s->row[1]),
                           v_double_dot(exact, s->row[2])};
    vfloat zero = v_splat(0.0f), height = v_splat(INFINITY), slope = zero;
    if (plane) {
        height = coordinate(plane, vec_double_sub(eye, plane->centre), 0);
        slope = vec_dot(vec_set(plane->normal), direction);
    }
    // t counts from the point nearest to the centre, so that it has the shape's size.
    vdouble path = v_double_product(o, d),
            back = {v_half_splat(0.0) - path.low, v_half_splat(0.0) - path.high};
    struct vec_double c = {v_double_along(o.x, d.x, back), v_double_along(o.y, d.y, back),
                           v_double_along(o.z, d.z, back)};
    vfloat before = v_double_to_float(back);
    vfloat to =
        v_sqrt(v_max(v_splat(s->a * s->a) - v_double_to_float(v_double_product(c, c)), zero));
    vmask near = v_and(v_and(active, v_cmp_gt(to, zero)), v_cmp_gt(before + to, zero));
    v_store(zero, &queues->marched[MARCH_T][slot]);
    v_store(zero, &queues->marched[MARCH_LAST_STEP][slot]);
    v_store(zero, &queues->marched[MARCH_EVALS][slot]);
    v_store(v_splat(-1.0f), &queues->marched[MARCH_FOUND][slot]);
    if (!v_any(near))
        return;
    float (*field)[BULB_ROOM] = queues->bulb;
    int at = queues->single_count;
    pack_bulb_rays(near, c, d, field, at);
    pack_wide(near, path, field + B_T, 1, at);
    pack_wide(near, back, field + B_BEFORE, 1, at);
    v_store(v_iota() + v_splat((float)at), field[B_RAY] + at);
    v_store(zero, field[B_STEPS] + at);
    v_compress_store(near, to, field[B_TO] + at);
    v_compress_store(near, v_iota() + v_splat((float)slot), field[B_SLOT] + at);
    v_compress_store(near, v_madd(before, slope, height), field[B_HEIGHT] + at);
    v_compress_store(near, slope, field[B_SLOPE] + at);
    queues->single_count += v_count(near);
}
