// Marches camera and mirror rays close to a Mandelbulb, where the last digits of a ray's steps decide where
// it ends. The first iteration comes from polynomials along a piece of the ray (bulb/chebyshev_pieces.c).
#include "bulb/bulb_chebyshev.h"
#include "bulb/bulb_estimate.h"

// At the end of a piece, a ray leaves for the march in floats if its estimate is above this.
#define LEAVE_ESTIMATE 1e-2f

enum { REFILL_CLOSE = 3 * LANES / 4 }; // ended lanes that make a refill worth its moves

// Fills ended lanes with the next rays, if there are any. steps: the count of all steps so far.
static void refill_chebyshev(struct chebyshev_lanes *to, struct ray_pieces *from, float steps,
                             struct worker_scratch *scratch) {
    for (unsigned ended = ~to->live & ((1u << LANES) - 1); ended;) {
        if (from->next == from->count) {
            if (scratch->close_first == scratch->close_count)
                return;
            prepare_pieces(scratch, from);
        }
        unsigned now = ended;
        int more = __builtin_popcount(ended) - (from->count - from->next);
        for (; more > 0; more--)
            now &= now - 1;
        v_expand_rows(to->field, N_FIELDS, now, &from->field[0][from->next], 2 * LANES);
        to->field[N_STEPS] =
            v_select(v_mask_of_bits(now), v_splat(steps) - to->field[N_STEPS], to->field[N_STEPS]);
        from->next += __builtin_popcount(now);
        to->live |= now;
        ended &= ~now;
    }
}

struct chebyshev_packet {
    vfloat t, estimate;
    vmask done, reached, met;
};

// Returns the orbit after the first iteration, from the polynomials.
static inline struct scaled_orbit chebyshev_orbit(const struct chebyshev_lanes *lanes, vfloat t,
                                                  vmask done) {
    const vfloat *term = lanes->field + N_TERM + 3 * (CLOSE_TERMS - 1);
    const vfloat *of_slope = lanes->field + N_SLOPE_TERM;
    vfloat x = term[0], y = term[1], z = term[2], slope = of_slope[SLOPE_TERMS - 1];
    for (int k = 1; k < CLOSE_TERMS; k++) {
        term -= 3;
        x = v_madd(x, t, term[0]);
        y = v_madd(y, t, term[1]);
        z = v_madd(z, t, term[2]);
    }
    for (int k = SLOPE_TERMS - 2; k >= 0; k--)
        slope = v_madd(slope, t, of_slope[k]);
    vfloat flat = v_madd(x, x, v_madd(z, z, v_splat(1e-30f)));
    vfloat m = v_madd(y, y, flat);
    return (struct scaled_orbit){
        x, y, z, flat, m, slope, v_splat(1.0f), v_not(done), v_mask_none()};
}

// Moves each ray on (bulb/bulb_steps.h). oldest: rays that took their lane
// before this count have taken all their steps.
static inline void advance_chebyshev(struct chebyshev_packet *p, vfloat field[N_FIELDS], vfloat h,
                                     vfloat hit_distance, vfloat oldest) {
    vfloat born = field[N_STEPS];
    born = v_select(p->done, born + v_splat(1.0f), born); // a lane that waits takes no step
    vfloat height = v_madd(p->t, field[N_SLOPE], field[N_HEIGHT]);
    vmask live = v_not(p->done), reached;
    vfloat step = close_step(field + N_STATE, live, h, height, hit_distance, &reached);
    p->estimate = v_select(live, h, p->estimate);
    p->t = p->t + v_select_or_zero(live, step);
    p->reached = v_or(p->reached, reached);
    p->met = v_or(p->met, v_cmp_ge_in(reached, height, h));
    live = v_cmp_ngt_in(v_andnot(reached, live), p->t, field[N_END]);
    p->done = v_not(v_cmp_nge_in(live, oldest, born));
    field[N_STEPS] = born;
}

// One step of the first `count` packets. Returns how many of their lanes have ended.
__attribute__((always_inline)) static inline int
step_chebyshev(const struct primitive *s, int count, struct chebyshev_lanes *lanes,
               struct chebyshev_packet *p, vfloat hit_distance, vfloat oldest) {
    struct scaled_orbit b[INTERLEAVED];
    struct vec at[INTERLEAVED] = {0};
    vfloat h[INTERLEAVED];
    for (int k = 0; k < count; k++) {
        const vfloat *field = lanes[k].field;
        at[k] = vec_along(
            (struct vec){field[N_PLACE], field[N_PLACE + 1], field[N_PLACE + 2]},
            (struct vec){field[N_DIRECTION], field[N_DIRECTION + 1], field[N_DIRECTION + 2]},
            p[k].t);
        b[k] = chebyshev_orbit(&lanes[k], p[k].t, p[k].done);
        ACTIVE(v_count(b[k].on));
        COUNT(bulb_estimate, call);
        b[k].on = v_cmp_ngt_in(b[k].on, b[k].m, v_splat(s->bailout));
    }
    bulbs_end(s, 1, false, true, false, count, b, at, h);
    int ended = 0;
    for (int k = 0; k < count; k++) {
        advance_chebyshev(&p[k], lanes[k].field, h[k], hit_distance, oldest);
        ended += v_count(p[k].done);
    }
    return ended;
}

static double field_double(const struct worker_scratch *scratch, int field, int ray) {
    return (double)scratch->bulb[field][ray] + (double)scratch->bulb[field + B_LOW][ray];
}

// Stores the hit of a ray at middle + way, if it is the nearest so far.
static void store_chebyshev_hit(struct worker_scratch *scratch, int ray, float middle, float way) {
    double t = (double)middle + (double)way;
    int slot = (int)scratch->bulb[B_SLOT][ray];
    float all = (float)((double)scratch->bulb[B_BEFORE][ray] + t);
    if (!(all < scratch->met[slot]))
        return;
    scratch->met[slot] = all;
    scratch->met_shape[slot] = scratch->shape;
    for (int i = 0; i < 3; i++)
        scratch->met_at[i][slot] = (float)(field_double(scratch, B_ORIGIN + i, ray) +
                                           field_double(scratch, B_DIRECTION + i, ray) * t);
}

// Hands a ray back to bulb/bulb_march.c, which marches it in floats. t and rest: the distance as two floats.
static void leave_chebyshev(struct worker_scratch *scratch, int ray, float t, float rest,
                            float had) {
    int to = scratch->open_count++;
    for (int i = 0; i < B_LANE; i++)
        scratch->open[i][to] = scratch->bulb[i][ray];
    scratch->open[B_T][to] = t;
    scratch->open[B_T_LOW][to] = rest;
    scratch->open[B_STEPS][to] = had;
}

// Frees the lanes that have ended. Hits are stored; rays at the end of a piece are queued for the next one or
// leave.
static void retire_chebyshev(struct chebyshev_packet *p, struct chebyshev_lanes *from, float steps,
                             float most, struct worker_scratch *scratch) {
    from->field[N_T] = p->t;
    unsigned ended = v_mask_bits(p->done) & from->live;
    from->live &= ~ended;
    if (!ended)
        return;
    float way[LANES], middle[LANES], rays[LANES], had[LANES];
    vfloat taken = v_splat(steps) - from->field[N_STEPS];
    v_store(p->t, way);
    v_store(from->field[N_MIDDLE], middle);
    v_store(from->field[N_RAY], rays);
    for (unsigned hits = ended & v_mask_bits(p->met); hits; hits &= hits - 1) {
        int lane = __builtin_ctz(hits);
        store_chebyshev_hit(scratch, (int)rays[lane], middle[lane], way[lane]);
    }
    vmask over = v_or(v_cmp_gt(p->t, from->field[N_TO]), v_cmp_ge(taken, v_splat(most)));
    vmask on = v_andnot(v_or(p->reached, over), v_mask_of_bits(ended));
    if (!v_any(on))
        return;
    vfloat far = from->field[N_MIDDLE] + p->t, back = far - from->field[N_MIDDLE];
    vfloat rest = (from->field[N_MIDDLE] - (far - back)) + (p->t - back);
    vmask open = v_and(on, v_cmp_gt(p->estimate, v_splat(LEAVE_ESTIMATE)));
    v_store(far, way);
    v_store(rest, middle);
    v_store(taken, had);
    for (unsigned which = v_mask_bits(open); which; which &= which - 1) {
        int lane = __builtin_ctz(which);
        leave_chebyshev(scratch, (int)rays[lane], way[lane], middle[lane], had[lane]);
    }
    queue_close(v_andnot(open, on), from->field[N_RAY], far, rest, taken, scratch);
}

// Moves all rays to the first packet. Precondition: they are LANES at most.
static void join_chebyshev(struct chebyshev_lanes lanes[INTERLEAVED]) {
    for (int k = 1; k < INTERLEAVED; k++) {
        unsigned here = lanes[k].live, there = ~lanes[0].live & ((1u << LANES) - 1);
        if (!here)
            continue;
        while (__builtin_popcount(there) > __builtin_popcount(here))
            there &= there - 1;
        v_move_lanes((float *)lanes[0].field, there, (const float *)lanes[k].field, here, N_FIELDS);
        lanes[0].live |= there;
        lanes[k].live = 0;
    }
}

// Marches the close rays until none waits. It returns with rays still in lanes if too few are left to fill
// the lanes and some rays wait for the march in floats.
KERNEL_SHARED void march_chebyshev(const struct primitive *s, const struct limits *limits,
                                   struct chebyshev_lanes *lanes, struct ray_pieces *pieces,
                                   float *steps, struct worker_scratch *scratch) {
    float hit = (float)limits->hit_distance, most = (float)limits->max_steps;
    vfloat hit_distance = v_splat(hit > 0x1p-24f ? hit : 0x1p-24f);
    for (;;) {
        struct chebyshev_packet p[INTERLEAVED];
        int live = 0;
        for (int k = 0; k < INTERLEAVED; k++) {
            refill_chebyshev(&lanes[k], pieces, *steps, scratch);
            live += __builtin_popcount(lanes[k].live);
        }
        bool one = live <= LANES; // the tile's last rays: some take a thousand steps
        if (one)
            join_chebyshev(lanes);
        for (int k = 0; k < INTERLEAVED; k++) {
            p[k] = (struct chebyshev_packet){lanes[k].field[N_T], v_splat(0.0f),
                                             v_mask_of_bits(~lanes[k].live), v_mask_none(),
                                             v_mask_none()};
        }
        int ended = INTERLEAVED * LANES - live;
        bool more = pieces->next < pieces->count || scratch->close_first < scratch->close_count;
        if (ended == INTERLEAVED * LANES ||
            (!more && ended >= REFILL_CLOSE && scratch->open_count > 0))
            return;
        int enough = one ? INTERLEAVED * LANES : (INTERLEAVED - 1) * LANES;
        if (more || scratch->open_count > 0)
            enough = ended + REFILL_CLOSE;
        while (ended < enough && ended < INTERLEAVED * LANES && *steps < STEPS_COUNTED) {
            *steps += 1.0f;
            vfloat oldest = v_splat(*steps - most);
            if (one)
                ended = (INTERLEAVED - 1) * LANES +
                        step_chebyshev(s, 1, lanes, p, hit_distance, oldest);
            else
                ended = step_chebyshev(s, INTERLEAVED, lanes, p, hit_distance, oldest);
        }
        for (int k = 0; k < INTERLEAVED; k++)
            retire_chebyshev(&p[k], &lanes[k], *steps, most, scratch);
        if (*steps < STEPS_COUNTED)
            continue;
        for (int k = 0; k < INTERLEAVED; k++)
            lanes[k].field[N_STEPS] = lanes[k].field[N_STEPS] - v_splat(*steps);
        *steps = 0.0f;
    }
}
