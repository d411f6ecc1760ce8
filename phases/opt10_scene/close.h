// Camera rays that are close to a Mandelbulb: their last digits decide where they end (bulb.c). Along a ray the map's
// first iteration is a smooth function of t, and steps are short here: it is told for a piece of the ray at once, as
// polynomials through CLOSE_TERMS of its places, in doubles. A step then errs by a float's rounding at the size of
// the piece, and by that of the map's later iterations, which the derivative divides.
//
// The map is singular on the axis ρ = 0 alone, which a ray meets at complex t, too, no nearer than ρ to a place where it
// has ρ. On pieces of half length ρ/32, 0.02 at most, the polynomials are off by less than 2^-24, a float's
// rounding of 1 (tests/py/test_close.py; ρ/16: 46 times that), as long as ρ is 1e-5 or more: nearer to the axis a
// piece is CLOSE_LEAST and not shorter, and they are off by up to 2e-5 at ρ = 1e-6. Interpolation at Chebyshev's
// points: Trefethen, Approximation Theory and Approximation Practice, 2013; distance to a singularity, its chapter 8.
#ifndef OPT10_CLOSE_H
#define OPT10_CLOSE_H

#include "bulb.h"
#include "stage.h"

#include <string.h>

// From such an estimate on a ray is close, and until such a one at the end of its piece. Not by the step, which may be
// short over a plane: far out, where the first iteration has escaped, close_first()'s estimate is too short.
#define CLOSE 5e-3f
#define CLOSE_LEAVES 1e-2f
#define CLOSE_PIECE 0.02f // half length of a piece, at most
#define CLOSE_LEAST 0x1p-20f
#define CLOSE_SHARE 0.03125f                               // of ρ
enum { CLOSE_TERMS = 6, SLOPE_TERMS = 4, CLOSE_TOLD = 4 }; // x, y, z and the derivative

// What a lane knows; all from the middle of its piece.
enum close_field {
    N_TERM, // the constants of x, y and z, then the factors of t …
    N_SLOPE_TERM = 3 * CLOSE_TERMS,
    N_PLACE = N_SLOPE_TERM + SLOPE_TERMS,
    N_DIRECTION = N_PLACE + 3,
    N_T = N_DIRECTION + 3,
    N_END, // of the piece, or of the ray
    N_TO,  // of the ray
    N_HEIGHT,
    N_SLOPE,
    N_MIDDLE,
    N_RAY, // which one on the desk
    N_BORN,
    N_FIELDS
};

struct close_lanes {
    real field[N_FIELDS];
    unsigned live;
};

// Rays that have their pieces, and wait for lanes. N_BORN: the steps that they have had.
struct pieces {
    float field[N_FIELDS][2 * LANES];
    int next, count;
};

enum { REFILL_CLOSE = 3 * LANES / 4 }; // as REFILL, where more is moved for each
// Steps are counted in floats, by ones: from 2^24 on a float stands still. Counted so far, births are told anew from there.
#define STEPS_COUNTED 0x1p23f

static inline wide wide_along(wide origin, wide direction, wide t) {
    return (wide){half_mul_add(direction.low, t.low, origin.low),
                  half_mul_add(direction.high, t.high, origin.high)};
}

static inline struct wide_vec places(struct wide_vec o, struct wide_vec d, wide t) {
    COUNT(places, call);
    return (struct wide_vec){wide_along(o.x, d.x, t), wide_along(o.y, d.y, t),
                             wide_along(o.z, d.z, t)};
}

// The rays of the lanes in m wait for their next pieces. t is two floats.
static void wait_close(mask m, real ray, real t, real rest, real had, struct desk *desk) {
    COUNT(wait_close, call);
    if (desk->closes + 2 * LANES > CLOSE_ROOM) { // whole registers are read from the last ray on
        int left = desk->closes - desk->close_first;
        for (int i = 0; i < C_FIELDS; i++)
            memmove(desk->close[i], desk->close[i] + desk->close_first,
                    (size_t)left * sizeof(float));
        desk->close_first = 0;
        desk->closes = left;
    }
    pack(m, ray, &desk->close[C_RAY][desk->closes]);
    pack(m, t, &desk->close[C_T][desk->closes]);
    pack(m, rest, &desk->close[C_REST][desk->closes]);
    pack(m, had, &desk->close[C_HAD][desk->closes]);
    desk->closes += count_of(m);
}

static inline wide wide_plus(wide a, wide b) {
    return (wide){a.low + b.low, a.high + b.high};
}

static inline wide wide_minus(wide a, wide b) {
    return (wide){a.low - b.low, a.high - b.high};
}

static inline void first_of_wide(struct wide_vec place, wide to[CLOSE_TOLD]) {
    COUNT(bulb_first, both);
    struct half_bulb low = bulb_first(place.x.low, place.y.low, place.z.low);
    struct half_bulb high = bulb_first(place.x.high, place.y.high, place.z.high);
    to[0] = (wide){low.x, high.x};
    to[1] = (wide){low.y, high.y};
    to[2] = (wide){low.z, high.z};
    to[3] = (wide){low.slope, high.slope};
}

// One coordinate's: even and odd part of the values at ±node·end, by the inverse of the nodes' powers.
static inline void put_terms(const wide sum[3], const wide difference[3],
                             const real power[CLOSE_TERMS], int axis, struct pieces *to) {
    static const double even[3][3] = {
        {0.044658198738520484, -0.16666666666666696, 0.62200846792814624},
        {-0.75598306414370742, 2.6666666666666665, -1.9106836025229585},
        {1.333333333333333, -2.6666666666666661, 1.3333333333333328}};
    static const double odd[3][3] = {{0.046233569414009822, -0.23570226039551659, 2.40325617336917},
                                     {-0.7826512591014092, 3.7712361663282561, -7.3823145501758569},
                                     {1.3803682405467781, -3.7712361663282552, 5.151604406875034}};
    COUNT(put_terms, call);
    for (int k = 0; k < CLOSE_TERMS; k++) {
        const double *row = k % 2 ? odd[k / 2] : even[k / 2];
        const wide *value = k % 2 ? difference : sum;
        wide term = wide_mul_add(value[0], row[0],
                                 wide_mul_add(value[1], row[1], wide_mul(value[2], row[2])));
        real factor = narrow(term);
        if (k > 0)
            factor = factor * power[k];
        unload(factor, to->field[N_TERM + 3 * k + axis]);
    }
}

// The derivative's: the first of the Chebyshev polynomials through its values. It scales the estimate alone: a step's
// length errs by less than 2^-19 of itself, and no pixel was seen to need more (opt9_convex's HISTORY, "Fewer products").
static inline void put_slope(const wide sum[3], const wide difference[3],
                             const real power[CLOSE_TERMS], struct pieces *to) {
    static const double slope[SLOPE_TERMS][3] = {
        {-0.12200846792814626, 0.16666666666666657, 0.45534180126147961},
        {-0.38513150575685806, 0.94280904158206325, 0.79337979622072108},
        {0.57735026918962584, 0.0, -0.57735026918962584},
        {0.94280904158206325, -0.94280904158206325, -0.94280904158206325}};
    COUNT(put_slope, call);
    for (int k = 0; k < SLOPE_TERMS; k++) {
        const wide *value = k % 2 ? difference : sum;
        wide term =
            wide_mul_add(value[0], slope[k][0],
                         wide_mul_add(value[1], slope[k][1], wide_mul(value[2], slope[k][2])));
        real factor = narrow(term);
        if (k > 0)
            factor = factor * power[k];
        unload(factor, to->field[N_SLOPE_TERM + k]);
    }
}

static void put_pieces(struct wide_vec o, struct wide_vec d, wide middle, real end, real per_end,
                       struct pieces *to) {
    static const double nodes[3] = {0.96592582628906831, 0.70710678118654757, 0.25881904510252074};
    COUNT(put_pieces, call);
    wide sum[CLOSE_TOLD][3], difference[CLOSE_TOLD][3], reach = wide_sum(end, set(0.0f));
    for (int i = 0; i < 3; i++) {
        wide away = wide_mul(reach, nodes[i]), before[CLOSE_TOLD], behind[CLOSE_TOLD];
        first_of_wide(places(o, d, wide_minus(middle, away)), before);
        first_of_wide(places(o, d, wide_plus(middle, away)), behind);
        for (int axis = 0; axis < CLOSE_TOLD; axis++) {
            sum[axis][i] = wide_plus(behind[axis], before[axis]);
            difference[axis][i] = wide_minus(behind[axis], before[axis]);
        }
    }
    real power[CLOSE_TERMS] = {set(1.0f), per_end};
    for (int k = 2; k < CLOSE_TERMS; k++)
        power[k] = power[k - 1] * per_end;
    for (int axis = 0; axis < 3; axis++)
        put_terms(sum[axis], difference[axis], power, axis, to);
    put_slope(sum[3], difference[3], power, to);
}

// The pieces on which the first rays that wait are to go on.
static void prepare_close(struct desk *desk, struct pieces *to) {
    int first = desk->close_first, count = desk->closes - first;
    count = count < LANES ? count : LANES;
    ACTIVE(count);
    COUNT(prepare_close, call);
    float of[B_FIELDS][LANES];
    int rays[LANES];
    for (int lane = 0; lane < LANES; lane++)
        rays[lane] = (int)desk->close[C_RAY][first + (lane < count ? lane : 0)];
    for (int i = 0; i < B_FIELDS; i++)
        for (int lane = 0; lane < LANES; lane++)
            of[i][lane] = desk->bulb[i][rays[lane]];
    wide ray[6];
    for (int i = 0; i < 6; i++)
        ray[i] = wide_sum(load(of[B_ORIGIN + i]), load(of[B_REST + i]));
    struct wide_vec o = {ray[0], ray[1], ray[2]}, d = {ray[3], ray[4], ray[5]};
    wide t = wide_sum(load(&desk->close[C_T][first]), load(&desk->close[C_REST][first]));
    struct wide_vec place = places(o, d, t);
    real x = narrow(place.x), z = narrow(place.z), rho = root(mul_add(x, x, z * z));
    real end = most_of(least_of(rho * set(CLOSE_SHARE), set(CLOSE_PIECE)), set(CLOSE_LEAST));
    real near_middle = narrow(t) + end;
    wide middle = wide_sum(near_middle, set(0.0f));
    put_pieces(o, d, middle, end, set(1.0f) / end, to);
    place = places(o, d, middle);
    unload(narrow(place.x), to->field[N_PLACE]);
    unload(narrow(place.y), to->field[N_PLACE + 1]);
    unload(narrow(place.z), to->field[N_PLACE + 2]);
    for (int i = 0; i < 3; i++)
        unload(load(of[B_DIRECTION + i]), to->field[N_DIRECTION + i]);
    real slope = load(of[B_SLOPE]);
    unload(narrow(wide_minus(t, middle)), to->field[N_T]);
    real until = load(of[B_TO]) - near_middle;
    unload(least_of(end, until), to->field[N_END]);
    unload(until, to->field[N_TO]);
    unload(mul_add(near_middle, slope, load(of[B_HEIGHT])), to->field[N_HEIGHT]);
    unload(slope, to->field[N_SLOPE]);
    unload(near_middle, to->field[N_MIDDLE]);
    unload(load(&desk->close[C_RAY][first]), to->field[N_RAY]);
    unload(load(&desk->close[C_HAD][first]), to->field[N_BORN]);
    to->next = 0;
    to->count = count;
    desk->close_first += count;
}

// Lanes that have ended take the next rays, if there are any. steps: of all so far.
static void refill_close(struct close_lanes *to, struct pieces *from, float steps,
                         struct desk *desk) {
    COUNT(refill_close, call);
    for (unsigned ended = ~to->live & ((1u << LANES) - 1); ended;) {
        if (from->next == from->count) {
            if (desk->close_first == desk->closes)
                return;
            prepare_close(desk, from);
        }
        unsigned now = ended;
        int more = __builtin_popcount(ended) - (from->count - from->next);
        for (; more > 0; more--)
            now &= now - 1;
        ACTIVE(__builtin_popcount(now));
        COUNT(refill_close, taken);
        expand_rows(to->field, N_FIELDS, now, &from->field[0][from->next], 2 * LANES);
        to->field[N_BORN] =
            choose(lanes_of(now), set(steps) - to->field[N_BORN], to->field[N_BORN]);
        from->next += __builtin_popcount(now);
        to->live |= now;
        ended &= ~now;
    }
}

struct close_packet {
    real t, estimate;
    mask done, reached, met;
};

// After the first iteration.
static inline struct bulb close_first(const struct close_lanes *lanes, real t, mask done) {
    ACTIVE(LANES);
    COUNT(close_first, call);
    const real *term = lanes->field + N_TERM + 3 * (CLOSE_TERMS - 1);
    const real *of_slope = lanes->field + N_SLOPE_TERM;
    real x = term[0], y = term[1], z = term[2], slope = of_slope[SLOPE_TERMS - 1];
    for (int k = 1; k < CLOSE_TERMS; k++) {
        term -= 3;
        x = mul_add(x, t, term[0]);
        y = mul_add(y, t, term[1]);
        z = mul_add(z, t, term[2]);
    }
    for (int k = SLOPE_TERMS - 2; k >= 0; k--)
        slope = mul_add(slope, t, of_slope[k]);
    real flat = mul_add(x, x, mul_add(z, z, set(1e-30f)));
    real m = mul_add(y, y, flat);
    return (struct bulb){x, y, z, flat, m, slope, set(1.0f), not_in(done), no_lane()};
}

static inline void advance_close(struct close_packet *p, real field[N_FIELDS], real h,
                                 real hit_distance, real oldest) {
    ACTIVE(LANES - count_of(p->done));
    COUNT(advance_close, call);
    real born = field[N_BORN];
    born = choose(p->done, born + set(1.0f), born); // waiting for others is no step
    real height = mul_add(p->t, field[N_SLOPE], field[N_HEIGHT]), least = least_of(h, height);
    mask live = not_in(p->done), reached = less_in(live, least, hit_distance);
    p->estimate = choose(live, h, p->estimate);
    p->t = p->t + keep(live, least);
    p->reached = either(p->reached, reached);
    p->met = either(p->met, not_less_in(reached, height, h));
    live = but_greater(but_not(reached, live), p->t, field[N_END]);
    p->done = not_in(but_not_less(live, oldest, born));
    field[N_BORN] = born;
}

// A step of the first `count` packets. How many of their lanes have ended.
__attribute__((always_inline)) static inline int step_close(const struct placed *s, int count,
                                                            struct close_lanes *lanes,
                                                            struct close_packet *p,
                                                            real hit_distance, real oldest) {
    struct bulb b[ABREAST];
    struct vec at[ABREAST] = {0};
    real h[ABREAST];
    COUNT(step_close, call);
    for (int k = 0; k < count; k++) {
        const real *field = lanes[k].field;
        ACTIVE(LANES - count_of(p[k].done));
        COUNT(step_close, packet);
        at[k] = vec_along(
            (struct vec){field[N_PLACE], field[N_PLACE + 1], field[N_PLACE + 2]},
            (struct vec){field[N_DIRECTION], field[N_DIRECTION + 1], field[N_DIRECTION + 2]},
            p[k].t);
        b[k] = close_first(&lanes[k], p[k].t, p[k].done);
        b[k].on = but_greater(b[k].on, b[k].m, set(s->bailout));
    }
    bulbs_end(s, 1, false, true, false, count, b, at, h);
    int ended = 0;
    for (int k = 0; k < count; k++) {
        advance_close(&p[k], lanes[k].field, h[k], hit_distance, oldest);
        ended += count_of(p[k].done);
    }
    return ended;
}

static double exact(const struct desk *desk, int field, int ray) {
    return (double)desk->bulb[field][ray] + (double)desk->bulb[field + B_REST][ray];
}

static void meet_close(struct desk *desk, int ray, float middle, float way) {
    COUNT(meet_close, call);
    double t = (double)middle + (double)way;
    int slot = (int)desk->bulb[B_SLOT][ray];
    float all = (float)((double)desk->bulb[B_BEFORE][ray] + t);
    if (!(all < desk->met[slot]))
        return;
    COUNT(meet_close, met);
    desk->met[slot] = all;
    desk->met_shape[slot] = desk->shape;
    for (int i = 0; i < 3; i++)
        desk->met_at[i][slot] =
            (float)(exact(desk, B_ORIGIN + i, ray) + exact(desk, B_DIRECTION + i, ray) * t);
}

// Back to the rays that bulb.c marches in floats.
static void leave_close(struct desk *desk, int ray, float t, float rest, float had) {
    int to = desk->opens++;
    for (int i = 0; i < B_LANE; i++)
        desk->open[i][to] = desk->bulb[i][ray];
    desk->open[B_T][to] = t;
    desk->open[B_MORE][to] = rest;
    desk->open[B_BORN][to] = had;
}

// What has ended gives its answer; what is at the end of its piece waits for the next, and all are no longer live.
static void retire_close(struct close_packet *p, struct close_lanes *from, float steps, float most,
                         struct desk *desk) {
    ACTIVE(count_of(lanes_of(from->live)));
    COUNT(retire_close, call);
    from->field[N_T] = p->t;
    unsigned ended = bits(p->done) & from->live;
    from->live &= ~ended;
    if (!ended)
        return;
    COUNT(retire_close, ended);
    float way[LANES], middle[LANES], rays[LANES], had[LANES];
    real taken = set(steps) - from->field[N_BORN];
    unload(p->t, way);
    unload(from->field[N_MIDDLE], middle);
    unload(from->field[N_RAY], rays);
    for (unsigned hits = ended & bits(p->met); hits; hits &= hits - 1) {
        int lane = __builtin_ctz(hits);
        meet_close(desk, (int)rays[lane], middle[lane], way[lane]);
    }
    mask over = either(greater(p->t, from->field[N_TO]), not_less(taken, set(most)));
    mask on = but_not(either(p->reached, over), lanes_of(ended));
    if (!any(on))
        return;
    ACTIVE(count_of(on));
    COUNT(retire_close, on);
    real far = from->field[N_MIDDLE] + p->t, back = far - from->field[N_MIDDLE];
    real rest = (from->field[N_MIDDLE] - (far - back)) + (p->t - back);
    mask open = both(on, greater(p->estimate, set(CLOSE_LEAVES)));
    unload(far, way);
    unload(rest, middle);
    unload(taken, had);
    for (unsigned which = bits(open); which; which &= which - 1) {
        int lane = __builtin_ctz(which);
        leave_close(desk, (int)rays[lane], way[lane], middle[lane], had[lane]);
    }
    wait_close(but_not(open, on), from->field[N_RAY], far, rest, taken, desk);
}

// Few are left: all of them in the first packet.
static void join_close(struct close_lanes lanes[ABREAST]) {
    COUNT(join_close, call);
    for (int k = 1; k < ABREAST; k++) {
        unsigned here = lanes[k].live, there = ~lanes[0].live & ((1u << LANES) - 1);
        if (!here)
            continue;
        while (__builtin_popcount(there) > __builtin_popcount(here))
            there &= there - 1;
        move_lanes((float *)lanes[0].field, there, (const float *)lanes[k].field, here, N_FIELDS);
        lanes[0].live |= there;
        lanes[k].live = 0;
    }
}

// Marches the rays that wait, until none does: to the end, unless some are to be marched in floats before.
static void march_close(const struct placed *s, const struct limits *limits,
                        struct close_lanes lanes[ABREAST], struct pieces *pieces, float *steps,
                        struct desk *desk) {
    COUNT(march_close, call);
    float hit = (float)limits->hit_distance, most = (float)limits->max_steps;
    real hit_distance = set(hit > 0x1p-24f ? hit : 0x1p-24f);
    for (;;) {
        struct close_packet p[ABREAST];
        int live = 0;
        for (int k = 0; k < ABREAST; k++) {
            refill_close(&lanes[k], pieces, *steps, desk);
            live += __builtin_popcount(lanes[k].live);
        }
        bool one = live <= LANES; // a tile's last rays, some of which take a thousand steps
        if (one)
            join_close(lanes);
        for (int k = 0; k < ABREAST; k++) {
            COUNT(march_close, packet);
            p[k] = (struct close_packet){lanes[k].field[N_T], set(0.0f), lanes_of(~lanes[k].live),
                                         no_lane(), no_lane()};
        }
        int ended = ABREAST * LANES - live;
        bool more = pieces->next < pieces->count || desk->close_first < desk->closes;
        if (ended == ABREAST * LANES || (!more && ended >= REFILL_CLOSE && desk->opens > 0))
            return;
        int enough = one ? ABREAST * LANES : (ABREAST - 1) * LANES;
        if (more || desk->opens > 0)
            enough = ended + REFILL_CLOSE;
        while (ended < enough && ended < ABREAST * LANES && *steps < STEPS_COUNTED) {
            COUNT(march_close, step);
            *steps += 1.0f;
            real oldest = set(*steps - most);
            if (one)
                ended = (ABREAST - 1) * LANES + step_close(s, 1, lanes, p, hit_distance, oldest);
            else
                ended = step_close(s, ABREAST, lanes, p, hit_distance, oldest);
        }
        for (int k = 0; k < ABREAST; k++)
            retire_close(&p[k], &lanes[k], *steps, most, desk);
        if (*steps < STEPS_COUNTED)
            continue;
        for (int k = 0; k < ABREAST; k++)
            lanes[k].field[N_BORN] = lanes[k].field[N_BORN] - set(*steps);
        *steps = 0.0f;
    }
}

#endif
