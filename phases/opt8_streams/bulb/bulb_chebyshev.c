// Camera rays that are close to a Mandelbulb: the last digits of their steps decide where they end
// (bulb/bulb_single.c). Along a ray the map's first iteration is a smooth function of t, and steps are short here. So
// that iteration is evaluated for a piece of the ray at once, as polynomials through CLOSE_TERMS points, in doubles. A
// step then has the rounding error of a float at the size of the piece, and that of the later iterations, which the
// derivative divides.
//
// The map is singular on the axis ρ = 0 only. From a point with ρ, a ray meets the axis at complex t no nearer than ρ.
// On pieces of half length ρ/32, at most 0.02, the polynomials are off by less than 2^-24, a float's rounding of 1
// (tests/phases/test_bulb_chebyshev.py; ρ/16: 46 times that), for ρ ≥ 1e-5. Nearer to the axis a piece is CLOSE_PIECE_MIN, and they
// are off by up to 2e-5 at ρ = 1e-6. Interpolation at Chebyshev's points: Trefethen, Approximation Theory and
// Approximation Practice, 2013; distance to a singularity, its chapter 8.
#include "bulb/bulb_chebyshev.h"
#include "bulb/bulb_estimate.h"
#include "core/ray_queues.h"

#include <string.h>

#define LEAVE_ESTIMATE 1e-2f
#define CLOSE_PIECE 0.02f // half length of a piece, at most
#define CLOSE_PIECE_MIN 0x1p-20f
#define CLOSE_PIECE_SHARE 0.03125f // of ρ

enum { REFILL_CLOSE = LANES / 2 }; // ended lanes

static inline struct vec_double points_along(struct vec_double o, struct vec_double d, vdouble t) {
    return (struct vec_double){v_double_along(o.x, d.x, t), v_double_along(o.y, d.y, t),
                               v_double_along(o.z, d.z, t)};
}

void queue_close(vmask m, vfloat ray, vfloat t, vfloat t_lo, vfloat evals,
                 struct ray_queues *queues) {
    if (queues->close_count + 2 * LANES >
        CLOSE_ROOM) { // loading reads whole registers from the last ray on
        int left = queues->close_count - queues->close_first;
        for (int i = 0; i < C_FIELDS; i++)
            memmove(queues->close[i], queues->close[i] + queues->close_first,
                    (size_t)left * sizeof(float));
        queues->close_first = 0;
        queues->close_count = left;
    }
    v_compress_store(m, ray, &queues->close[C_RAY][queues->close_count]);
    v_compress_store(m, t, &queues->close[C_T][queues->close_count]);
    v_compress_store(m, t_lo, &queues->close[C_T_LO][queues->close_count]);
    v_compress_store(m, evals, &queues->close[C_EVALS][queues->close_count]);
    queues->close_count += v_count(m);
}

static inline vdouble v_double_plus(vdouble a, vdouble b) {
    return (vdouble){a.low + b.low, a.high + b.high};
}

static inline vdouble v_double_minus(vdouble a, vdouble b) {
    return (vdouble){a.low - b.low, a.high - b.high};
}

static inline void lane0_double(struct vec_double place, vdouble to[CLOSE_VALUES]) {
    struct orbit_double low = bulb_first(place.x.low, place.y.low, place.z.low);
    struct orbit_double high = bulb_first(place.x.high, place.y.high, place.z.high);
    to[0] = (vdouble){low.x, high.x};
    to[1] = (vdouble){low.y, high.y};
    to[2] = (vdouble){low.z, high.z};
    to[3] = (vdouble){low.slope, high.slope};
}

// Stores one coordinate's polynomial: even and odd part of the values at ±node·end, by the inverse of the nodes'
// powers.
static inline void store_terms(const vdouble sum[3], const vdouble difference[3],
                               const vfloat power[CLOSE_TERMS], int axis, struct ray_pieces *to) {
    static const double even[3][3] = {
        {0.044658198738520484, -0.16666666666666696, 0.62200846792814624},
        {-0.75598306414370742, 2.6666666666666665, -1.9106836025229585},
        {1.333333333333333, -2.6666666666666661, 1.3333333333333328}};
    static const double odd[3][3] = {{0.046233569414009822, -0.23570226039551659, 2.40325617336917},
                                     {-0.7826512591014092, 3.7712361663282561, -7.3823145501758569},
                                     {1.3803682405467781, -3.7712361663282552, 5.151604406875034}};
    for (int k = 0; k < CLOSE_TERMS; k++) {
        const double *row = k % 2 ? odd[k / 2] : even[k / 2];
        const vdouble *value = k % 2 ? difference : sum;
        vdouble term = v_double_madd(
            value[0], row[0], v_double_madd(value[1], row[1], v_double_mul(value[2], row[2])));
        vfloat factor = v_double_to_float(term);
        if (k > 0)
            factor = factor * power[k];
        v_store(factor, to->field[N_TERM + CLOSE_VALUES * k + axis]);
    }
}

static void store_pieces(struct vec_double o, struct vec_double d, vdouble middle, vfloat end,
                         vfloat per_end, struct ray_pieces *to) {
    static const double nodes[3] = {0.96592582628906831, 0.70710678118654757, 0.25881904510252074};
    vdouble sum[CLOSE_VALUES][3], difference[CLOSE_VALUES][3],
        reach = v_double_sum(end, v_splat(0.0f));
    for (int i = 0; i < 3; i++) {
        vdouble away = v_double_mul(reach, nodes[i]), before[CLOSE_VALUES], behind[CLOSE_VALUES];
        lane0_double(points_along(o, d, v_double_minus(middle, away)), before);
        lane0_double(points_along(o, d, v_double_plus(middle, away)), behind);
        for (int axis = 0; axis < CLOSE_VALUES; axis++) {
            sum[axis][i] = v_double_plus(behind[axis], before[axis]);
            difference[axis][i] = v_double_minus(behind[axis], before[axis]);
        }
    }
    vfloat power[CLOSE_TERMS] = {v_splat(1.0f), per_end};
    for (int k = 2; k < CLOSE_TERMS; k++)
        power[k] = power[k - 1] * per_end;
    for (int axis = 0; axis < CLOSE_VALUES; axis++)
        store_terms(sum[axis], difference[axis], power, axis, to);
}

// Makes the next pieces of the first rays that wait.
static void prepare_pieces(struct ray_queues *queues, struct ray_pieces *to) {
    int first = queues->close_first, count = queues->close_count - first;
    count = count < LANES ? count : LANES;
    float of[B_FIELDS][LANES];
    int rays[LANES];
    for (int lane = 0; lane < LANES; lane++)
        rays[lane] = (int)queues->close[C_RAY][first + (lane < count ? lane : 0)];
    for (int i = 0; i < B_FIELDS; i++)
        for (int lane = 0; lane < LANES; lane++)
            of[i][lane] = queues->single[i][rays[lane]];
    vdouble ray[6];
    for (int i = 0; i < 6; i++)
        ray[i] = v_double_sum(v_load(of[B_ORIGIN + i]), v_load(of[B_LO + i]));
    struct vec_double o = {ray[0], ray[1], ray[2]}, d = {ray[3], ray[4], ray[5]};
    vdouble t =
        v_double_sum(v_load(&queues->close[C_T][first]), v_load(&queues->close[C_T_LO][first]));
    struct vec_double place = points_along(o, d, t);
    vfloat x = v_double_to_float(place.x), z = v_double_to_float(place.z),
           rho = v_sqrt(v_madd(x, x, z * z));
    vfloat end = v_max(v_min(rho * v_splat(CLOSE_PIECE_SHARE), v_splat(CLOSE_PIECE)),
                       v_splat(CLOSE_PIECE_MIN));
    vfloat near_middle = v_double_to_float(t) + end;
    vdouble middle = v_double_sum(near_middle, v_splat(0.0f));
    store_pieces(o, d, middle, end, v_splat(1.0f) / end, to);
    place = points_along(o, d, middle);
    v_store(v_double_to_float(place.x), to->field[N_PLACE]);
    v_store(v_double_to_float(place.y), to->field[N_PLACE + 1]);
    v_store(v_double_to_float(place.z), to->field[N_PLACE + 2]);
    for (int i = 0; i < 3; i++)
        v_store(v_load(of[B_DIRECTION + i]), to->field[N_DIRECTION + i]);
    vfloat slope = v_load(of[B_SLOPE]);
    v_store(v_double_to_float(v_double_minus(t, middle)), to->field[N_T]);
    vfloat until = v_load(of[B_END]) - near_middle;
    v_store(v_min(end, until), to->field[N_PIECE_END]);
    v_store(until, to->field[N_RAY_END]);
    v_store(v_madd(near_middle, slope, v_load(of[B_HEIGHT])), to->field[N_HEIGHT]);
    v_store(slope, to->field[N_SLOPE]);
    v_store(near_middle, to->field[N_MIDDLE]);
    v_store(v_load(&queues->close[C_RAY][first]), to->field[N_RAY]);
    v_store(v_load(&queues->close[C_EVALS][first]), to->field[N_EVALS]);
    to->next = 0;
    to->count = count;
    queues->close_first += count;
}

// Gives ended lanes the next rays, if there are any.
static void refill_chebyshev(struct chebyshev_lanes *to, struct ray_pieces *from,
                             struct ray_queues *queues) {
    for (unsigned ended = ~to->live & ((1u << LANES) - 1); ended;) {
        if (from->next == from->count) {
            if (queues->close_first == queues->close_count)
                return;
            prepare_pieces(queues, from);
        }
        unsigned now = ended;
        int more = __builtin_popcount(ended) - (from->count - from->next);
        for (; more > 0; more--)
            now &= now - 1;
        v_expand_rows(to->field, N_FIELDS, now, &from->field[0][from->next], 2 * LANES);
        from->next += __builtin_popcount(now);
        to->live |= now;
        ended &= ~now;
    }
}

struct chebyshev_packet {
    vfloat t, estimate, evals;
    vmask done, reached, met;
};

// Returns the orbit after the first iteration, from the polynomials.
static inline struct scaled_orbit chebyshev_orbit(const struct chebyshev_lanes *lanes, vfloat t,
                                                  vmask done) {
    const vfloat *term = lanes->field + N_TERM + CLOSE_VALUES * (CLOSE_TERMS - 1);
    vfloat x = term[0], y = term[1], z = term[2], slope = term[3];
    for (int k = 1; k < CLOSE_TERMS; k++) {
        term -= CLOSE_VALUES;
        x = v_madd(x, t, term[0]);
        y = v_madd(y, t, term[1]);
        z = v_madd(z, t, term[2]);
        slope = v_madd(slope, t, term[3]);
    }
    vfloat flat = v_madd(x, x, v_madd(z, z, v_splat(1e-30f)));
    vfloat m = v_madd(y, y, flat);
    return (struct scaled_orbit){
        x, y, z, flat, m, slope, v_splat(1.0f), v_not(done), v_mask_none()};
}

static inline void advance_chebyshev(struct chebyshev_packet *p, const vfloat field[N_FIELDS],
                                     vfloat h, vfloat hit_distance, vfloat cap) {
    vfloat height = v_madd(p->t, field[N_SLOPE], field[N_HEIGHT]), least = v_min(h, height);
    vmask live = v_not(p->done), reached = v_cmp_lt_in(live, least, hit_distance);
    p->estimate = v_select(live, h, p->estimate);
    p->evals = v_add_where(live, p->evals, v_splat(1.0f));
    p->t = p->t + v_select_or_zero(live, least);
    p->reached = v_or(p->reached, reached);
    p->met = v_or(p->met, v_cmp_nlt_in(reached, height, h));
    live = v_cmp_ngt_in(v_andnot(reached, live), p->t, field[N_PIECE_END]);
    p->done = v_not(v_cmp_lt_in(live, p->evals, cap));
}

// Takes a step of all packets. Returns how many lanes have ended.
static inline int step_chebyshev(const struct primitive *s, const struct chebyshev_lanes *lanes,
                                 struct chebyshev_packet *p, vfloat hit_distance, vfloat cap) {
    struct scaled_orbit b[INTERLEAVED];
    struct vec at[INTERLEAVED];
    vfloat h[INTERLEAVED];
    for (int k = 0; k < INTERLEAVED; k++) {
        const vfloat *field = lanes[k].field;
        ACTIVE(LANES - v_count(p[k].done));
        COUNT(chebyshev_step, call);
        at[k] = vec_along(
            (struct vec){field[N_PLACE], field[N_PLACE + 1], field[N_PLACE + 2]},
            (struct vec){field[N_DIRECTION], field[N_DIRECTION + 1], field[N_DIRECTION + 2]},
            p[k].t);
        b[k] = chebyshev_orbit(&lanes[k], p[k].t, p[k].done);
        b[k].on = v_cmp_ngt_in(b[k].on, b[k].m, v_splat(s->bailout));
    }
    bulbs_end(s, 1, false, true, false, INTERLEAVED, b, at, h);
    int ended = 0;
    for (int k = 0; k < INTERLEAVED; k++) {
        advance_chebyshev(&p[k], lanes[k].field, h[k], hit_distance, cap);
        ended += v_count(p[k].done);
    }
    return ended;
}

void store_march_result(struct ray_queues *queues, int ray, double t, float evals, float found) {
    int slot = (int)queues->single[B_SLOT][ray];
    double all =
        ((double)queues->single[B_BEFORE][ray] + (double)queues->single[B_BEFORE_LO][ray]) + t;
    float far = (float)all;
    bool goes_on = found < 0 && far < 0;
    queues->marched[MARCH_T][slot] = goes_on ? 0 : far;
    queues->marched[MARCH_LAST_STEP][slot] = (float)(all - (double)far);
    queues->marched[MARCH_EVALS][slot] = evals;
    queues->marched[MARCH_FOUND][slot] = found;
}

void march_outcome(vmask met, vmask reached, vfloat evals, vfloat cap, float counted[LANES],
                   float found[LANES]) {
    vmask capped = v_andnot(reached, v_cmp_ge(evals, cap)), plane = v_andnot(met, reached);
    v_store(evals - v_select_or_zero(plane, v_splat(1.0f)), counted);
    v_store(v_select(met, v_splat(1.0f), v_select(capped, v_splat(0.0f), v_splat(-1.0f))), found);
}

// Returns a ray to those that bulb/bulb_single.c marches in floats.
static void leave_chebyshev(struct ray_queues *queues, int ray, float t, float t_lo, float evals) {
    int to = queues->open_count++;
    for (int i = 0; i < B_LANE; i++)
        queues->open[i][to] = queues->single[i][ray];
    queues->open[B_T][to] = t;
    queues->open[B_T_LO][to] = t_lo;
    queues->open[B_EVALS][to] = evals;
}

// Stores the results of ended rays. Rays at the end of their piece wait for the next piece. Neither is live any more.
static void retire_chebyshev(struct chebyshev_packet *p, struct chebyshev_lanes *from, vfloat cap,
                             struct ray_queues *queues) {
    from->field[N_T] = p->t;
    from->field[N_EVALS] = p->evals;
    unsigned ended = v_mask_bits(p->done) & from->live;
    from->live &= ~ended;
    if (!ended)
        return;
    float path[LANES], middle[LANES], rays[LANES], evals[LANES], found[LANES];
    vmask over = v_or(v_cmp_gt(p->t, from->field[N_RAY_END]), v_cmp_ge(p->evals, cap));
    vmask on = v_andnot(v_or(p->reached, over), v_mask_of_bits(ended));
    v_store(p->t, path);
    v_store(from->field[N_MIDDLE], middle);
    v_store(from->field[N_RAY], rays);
    march_outcome(p->met, p->reached, p->evals, cap, evals, found);
    for (unsigned rest = ended & ~v_mask_bits(on); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest);
        store_march_result(queues, (int)rays[lane], (double)middle[lane] + (double)path[lane],
                           evals[lane], found[lane]);
    }
    if (!v_any(on))
        return;
    vfloat far = from->field[N_MIDDLE] + p->t, back = far - from->field[N_MIDDLE];
    vfloat rest = (from->field[N_MIDDLE] - (far - back)) + (p->t - back);
    vmask open = v_and(on, v_cmp_gt(p->estimate, v_splat(LEAVE_ESTIMATE)));
    v_store(far, path);
    v_store(rest, middle);
    for (unsigned which = v_mask_bits(open); which; which &= which - 1) {
        int lane = __builtin_ctz(which);
        leave_chebyshev(queues, (int)rays[lane], path[lane], middle[lane], evals[lane]);
    }
    queue_close(v_andnot(open, on), from->field[N_RAY], far, rest, p->evals, queues);
}

void march_chebyshev(const struct primitive *s, vfloat hit_distance, vfloat cap,
                     struct chebyshev_lanes *lanes, struct ray_pieces *pieces,
                     struct ray_queues *queues) {
    for (;;) {
        struct chebyshev_packet p[INTERLEAVED];
        int ended = 0;
        for (int k = 0; k < INTERLEAVED; k++) {
            refill_chebyshev(&lanes[k], pieces, queues);
            p[k] =
                (struct chebyshev_packet){lanes[k].field[N_T],     v_splat(0.0f),
                                          lanes[k].field[N_EVALS], v_mask_of_bits(~lanes[k].live),
                                          v_mask_none(),           v_mask_none()};
            ended += v_count(p[k].done);
        }
        bool more = pieces->next < pieces->count || queues->close_first < queues->close_count;
        if (ended == INTERLEAVED * LANES ||
            (!more && ended >= REFILL_CLOSE && queues->open_count > 0))
            return;
        int enough = more || queues->open_count > 0 ? ended + REFILL_CLOSE : INTERLEAVED * LANES;
        while (ended < enough && ended < INTERLEAVED * LANES)
            ended = step_chebyshev(s, lanes, p, hit_distance, cap);
        for (int k = 0; k < INTERLEAVED; k++)
            retire_chebyshev(&p[k], &lanes[k], cap, queues);
    }
}
