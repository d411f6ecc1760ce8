// Camera rays that are close to a Mandelbulb: the last digits of their steps decide where they end
// (bulb/bulb_single.c). So a piece of the ray at a time is marched on polynomials (simd/bulb_pieces.h). A step then has
// the rounding error of a float at the size of the piece, and that of the later iterations, which the derivative divides.
#include "bulb/bulb_chebyshev.h"
#include "bulb/bulb_estimate.h"
#include "core/ray_queues.h"

#define LEAVE_ESTIMATE 1e-2f

enum { REFILL_CLOSE = LANES / 2 }; // ended lanes

static void prepare_pieces(struct ray_queues *scratch, struct ray_pieces *to);

#define BULB_SCRATCH struct ray_queues
#include "simd/bulb_pieces.h"

static inline void store_slope(const vdouble sum[3], const vdouble difference[3],
                               const vfloat power[CLOSE_TERMS], struct ray_pieces *to) {
    (void)sum, (void)difference, (void)power, (void)to;
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
    live = v_cmp_ngt_in(v_andnot(reached, live), p->t, field[N_END]);
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
    int slot = (int)queues->bulb[B_SLOT][ray];
    double all = ((double)queues->bulb[B_BEFORE][ray] + (double)queues->bulb[B_BEFORE_LO][ray]) + t;
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
        queues->open[i][to] = queues->bulb[i][ray];
    queues->open[B_T][to] = t;
    queues->open[B_T_LOW][to] = t_lo;
    queues->open[B_STEPS][to] = evals;
}

// Stores the results of ended rays. Rays at the end of their piece wait for the next piece. Neither is live any more.
static void retire_chebyshev(struct chebyshev_packet *p, struct chebyshev_lanes *from, vfloat cap,
                             struct ray_queues *queues) {
    from->field[N_T] = p->t;
    from->field[N_STEPS] = p->evals;
    unsigned ended = v_mask_bits(p->done) & from->live;
    from->live &= ~ended;
    if (!ended)
        return;
    float path[LANES], middle[LANES], rays[LANES], evals[LANES], found[LANES];
    vmask over = v_or(v_cmp_gt(p->t, from->field[N_TO]), v_cmp_ge(p->evals, cap));
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
                                          lanes[k].field[N_STEPS], v_mask_of_bits(~lanes[k].live),
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
