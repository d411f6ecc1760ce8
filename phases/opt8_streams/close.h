// Camera rays that are close to a Mandelbulb: their last digits decide where they end (lone.c). Along a ray the map's
// first iteration is a smooth function of t, and steps are short here: it is told for a piece of the ray at once, as
// polynomials through CLOSE_TERMS of its places, in doubles. A step then errs by a float's rounding at the size of
// the piece, and by that of the map's later iterations, which the derivative divides.
//
// The map is singular on the axis ρ = 0 alone, which a ray meets at complex t, too, no nearer than ρ to a place where it
// has ρ. On pieces of half length ρ/32, 0.02 at most, the polynomials are off by less than 2^-24, a float's
// rounding of 1 (tests/py/test_close.py; ρ/16: 46 times that), as long as ρ is 1e-5 or more: nearer to the axis a
// piece is CLOSE_LEAST and not shorter, and they are off by up to 2e-5 at ρ = 1e-6. Interpolation at Chebyshev's
// points: Trefethen, Approximation Theory and Approximation Practice, 2013; distance to a singularity, its chapter 8.
#ifndef OPT8_CLOSE_H
#define OPT8_CLOSE_H

#include "bulb.h"
#include "streams.h"

#include <string.h>

// From such an estimate on a ray is close, and until such a one at the end of its piece. Not by the step, which may be
// short over a plane: far out, where the first iteration has escaped, close_first()'s estimate is too short.
#define CLOSE 5e-3f
#define CLOSE_LEAVES 1e-2f
#define CLOSE_PIECE 0.02f // half length of a piece, at most
#define CLOSE_LEAST 0x1p-20f
#define CLOSE_SHARE 0.03125f              // of ρ
enum { CLOSE_TERMS = 6, CLOSE_TOLD = 4 }; // x, y, z and the derivative

// What a lane knows; all from the middle of its piece.
enum close_field {
    N_TERM, // the constants of all that is told, then the factors of t …
    N_PLACE = CLOSE_TOLD * CLOSE_TERMS,
    N_DIRECTION = N_PLACE + 3,
    N_T = N_DIRECTION + 3,
    N_END, // of the piece, or of the ray
    N_TO,  // of the ray
    N_HEIGHT,
    N_SLOPE,
    N_MIDDLE,
    N_RAY, // which one on the desk
    N_HAD,
    N_FIELDS
};

struct close_lanes {
    real field[N_FIELDS];
    unsigned live;
};

// Rays that have their pieces, and wait for lanes.
struct pieces {
    float field[N_FIELDS][2 * LANES];
    int next, count;
};

enum { REFILL_LONE = LANES * LANES / 32, REFILL_CLOSE = LANES / 2 }; // ended lanes

static inline wide wide_along(wide origin, wide direction, wide t) {
    return (wide){half_mul_add(direction.low, t.low, origin.low),
                  half_mul_add(direction.high, t.high, origin.high)};
}

static inline struct wide_vec places_along(struct wide_vec o, struct wide_vec d, wide t) {
    COUNT(places_along, call);
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
    struct half_orbit low = bulb_first(place.x.low, place.y.low, place.z.low);
    struct half_orbit high = bulb_first(place.x.high, place.y.high, place.z.high);
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
        unload(factor, to->field[N_TERM + CLOSE_TOLD * k + axis]);
    }
}

static void put_pieces(struct wide_vec o, struct wide_vec d, wide middle, real end, real per_end,
                       struct pieces *to) {
    static const double nodes[3] = {0.96592582628906831, 0.70710678118654757, 0.25881904510252074};
    COUNT(put_pieces, call);
    wide sum[CLOSE_TOLD][3], difference[CLOSE_TOLD][3], reach = wide_sum(end, set(0.0f));
    for (int i = 0; i < 3; i++) {
        wide away = wide_mul(reach, nodes[i]), before[CLOSE_TOLD], behind[CLOSE_TOLD];
        first_of_wide(places_along(o, d, wide_minus(middle, away)), before);
        first_of_wide(places_along(o, d, wide_plus(middle, away)), behind);
        for (int axis = 0; axis < CLOSE_TOLD; axis++) {
            sum[axis][i] = wide_plus(behind[axis], before[axis]);
            difference[axis][i] = wide_minus(behind[axis], before[axis]);
        }
    }
    real power[CLOSE_TERMS] = {set(1.0f), per_end};
    for (int k = 2; k < CLOSE_TERMS; k++)
        power[k] = power[k - 1] * per_end;
    for (int axis = 0; axis < CLOSE_TOLD; axis++)
        put_terms(sum[axis], difference[axis], power, axis, to);
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
            of[i][lane] = desk->lone[i][rays[lane]];
    wide ray[6];
    for (int i = 0; i < 6; i++)
        ray[i] = wide_sum(load(of[B_ORIGIN + i]), load(of[B_REST + i]));
    struct wide_vec o = {ray[0], ray[1], ray[2]}, d = {ray[3], ray[4], ray[5]};
    wide t = wide_sum(load(&desk->close[C_T][first]), load(&desk->close[C_REST][first]));
    struct wide_vec place = places_along(o, d, t);
    real x = narrow(place.x), z = narrow(place.z), rho = root(mul_add(x, x, z * z));
    real end = most_of(least_of(rho * set(CLOSE_SHARE), set(CLOSE_PIECE)), set(CLOSE_LEAST));
    real near_middle = narrow(t) + end;
    wide middle = wide_sum(near_middle, set(0.0f));
    put_pieces(o, d, middle, end, set(1.0f) / end, to);
    place = places_along(o, d, middle);
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
    unload(load(&desk->close[C_HAD][first]), to->field[N_HAD]);
    to->next = 0;
    to->count = count;
    desk->close_first += count;
}

// Lanes that have ended take the next rays, if there are any.
static void refill_close(struct close_lanes *to, struct pieces *from, struct desk *desk) {
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
        expand_rows(to->field, N_FIELDS, now, &from->field[0][from->next], 2 * LANES);
        from->next += __builtin_popcount(now);
        to->live |= now;
        ended &= ~now;
    }
}

struct close_packet {
    real t, estimate, had;
    mask done, reached, met;
};

// After the first iteration.
static inline struct orbit close_first(const struct close_lanes *lanes, real t, mask done) {
    ACTIVE(LANES);
    COUNT(close_first, call);
    const real *term = lanes->field + N_TERM + CLOSE_TOLD * (CLOSE_TERMS - 1);
    real x = term[0], y = term[1], z = term[2], slope = term[3];
    for (int k = 1; k < CLOSE_TERMS; k++) {
        term -= CLOSE_TOLD;
        x = mul_add(x, t, term[0]);
        y = mul_add(y, t, term[1]);
        z = mul_add(z, t, term[2]);
        slope = mul_add(slope, t, term[3]);
    }
    real flat = mul_add(x, x, mul_add(z, z, set(1e-30f)));
    real m = mul_add(y, y, flat);
    return (struct orbit){x, y, z, flat, m, slope, set(1.0f), not_in(done), no_lane()};
}

static inline void advance_close(struct close_packet *p, const real field[N_FIELDS], real h,
                                 real hit_distance, real most) {
    ACTIVE(LANES - count_of(p->done));
    COUNT(advance_close, call);
    real height = mul_add(p->t, field[N_SLOPE], field[N_HEIGHT]), least = least_of(h, height);
    mask live = not_in(p->done), reached = less_in(live, least, hit_distance);
    p->estimate = choose(live, h, p->estimate);
    p->had = add_where(live, p->had, set(1.0f));
    p->t = p->t + keep(live, least);
    p->reached = either(p->reached, reached);
    p->met = either(p->met, not_less_in(reached, height, h));
    live = but_greater(but_not(reached, live), p->t, field[N_END]);
    p->done = not_in(less_in(live, p->had, most));
}

// A step of all packets. How many lanes have ended.
static inline int step_close(const struct placed *s, const struct close_lanes *lanes,
                             struct close_packet *p, real hit_distance, real most) {
    struct orbit b[ABREAST];
    struct vec at[ABREAST];
    real h[ABREAST];
    COUNT(step_close, call);
    for (int k = 0; k < ABREAST; k++) {
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
    bulbs_end(s, 1, false, true, false, ABREAST, b, at, h);
    int ended = 0;
    for (int k = 0; k < ABREAST; k++) {
        advance_close(&p[k], lanes[k].field, h[k], hit_distance, most);
        ended += count_of(p[k].done);
    }
    return ended;
}

// Where a ray's march is over: for recall(). t: from where it is nearest to the centre. What goes on among the other shapes
// may have come below the plane by its last step, and be behind the camera.
static void tell(struct desk *desk, int ray, double t, float evals, float found) {
    COUNT(tell, call);
    int slot = (int)desk->lone[B_SLOT][ray];
    double all = ((double)desk->lone[B_BEFORE][ray] + (double)desk->lone[B_BEFORE_MORE][ray]) + t;
    float far = (float)all;
    bool goes_on = found < 0 && far < 0;
    desk->marched[MARCHED_T][slot] = goes_on ? 0 : far;
    desk->marched[MARCHED_LAST][slot] = (float)(all - (double)far);
    desk->marched[MARCHED_EVALS][slot] = evals;
    desk->marched[MARCHED_FOUND][slot] = found;
}

// Of a packet's lanes that are over what tell() wants: what has come to the plane is to ask there again.
static inline void outcome(mask met, mask reached, real had, real most, float evals[LANES],
                           float found[LANES]) {
    COUNT(outcome, call);
    mask capped = but_not(reached, not_less(had, most)), plane = but_not(met, reached);
    unload(had - keep(plane, set(1.0f)), evals);
    unload(choose(met, set(1.0f), choose(capped, set(0.0f), set(-1.0f))), found);
}

// Back to the rays that lone.c marches in floats.
static void leave_close(struct desk *desk, int ray, float t, float rest, float had) {
    int to = desk->opens++;
    for (int i = 0; i < B_LANE; i++)
        desk->open[i][to] = desk->lone[i][ray];
    desk->open[B_T][to] = t;
    desk->open[B_MORE][to] = rest;
    desk->open[B_HAD][to] = had;
}

// What has ended is told; what is at the end of its piece waits for the next, and all are no longer live.
static void retire_close(struct close_packet *p, struct close_lanes *from, real most,
                         struct desk *desk) {
    ACTIVE(count_of(lanes_of(from->live)));
    COUNT(retire_close, call);
    from->field[N_T] = p->t;
    from->field[N_HAD] = p->had;
    unsigned ended = bits(p->done) & from->live;
    from->live &= ~ended;
    if (!ended)
        return;
    COUNT(retire_close, ended);
    float way[LANES], middle[LANES], rays[LANES], had[LANES], found[LANES];
    mask over = either(greater(p->t, from->field[N_TO]), not_less(p->had, most));
    mask on = but_not(either(p->reached, over), lanes_of(ended));
    unload(p->t, way);
    unload(from->field[N_MIDDLE], middle);
    unload(from->field[N_RAY], rays);
    outcome(p->met, p->reached, p->had, most, had, found);
    for (unsigned rest = ended & ~bits(on); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest);
        tell(desk, (int)rays[lane], (double)middle[lane] + (double)way[lane], had[lane],
             found[lane]);
    }
    if (!any(on))
        return;
    ACTIVE(count_of(on));
    COUNT(retire_close, on);
    real far = from->field[N_MIDDLE] + p->t, back = far - from->field[N_MIDDLE];
    real rest = (from->field[N_MIDDLE] - (far - back)) + (p->t - back);
    mask open = both(on, greater(p->estimate, set(CLOSE_LEAVES)));
    unload(far, way);
    unload(rest, middle);
    for (unsigned which = bits(open); which; which &= which - 1) {
        int lane = __builtin_ctz(which);
        leave_close(desk, (int)rays[lane], way[lane], middle[lane], had[lane]);
    }
    wait_close(but_not(open, on), from->field[N_RAY], far, rest, p->had, desk);
}

// Marches the rays that wait, until none does: to the end, unless some are to be marched in floats before.
static void march_close(const struct placed *s, real hit_distance, real most,
                        struct close_lanes lanes[ABREAST], struct pieces *pieces,
                        struct desk *desk) {
    COUNT(march_close, call);
    for (;;) {
        struct close_packet p[ABREAST];
        int ended = 0;
        for (int k = 0; k < ABREAST; k++) {
            refill_close(&lanes[k], pieces, desk);
            COUNT(march_close, packet);
            p[k] = (struct close_packet){lanes[k].field[N_T],      set(0.0f), lanes[k].field[N_HAD],
                                         lanes_of(~lanes[k].live), no_lane(), no_lane()};
            ended += count_of(p[k].done);
        }
        bool more = pieces->next < pieces->count || desk->close_first < desk->closes;
        if (ended == ABREAST * LANES || (!more && ended >= REFILL_CLOSE && desk->opens > 0))
            return;
        int enough = more || desk->opens > 0 ? ended + REFILL_CLOSE : ABREAST * LANES;
        while (ended < enough && ended < ABREAST * LANES)
            ended = step_close(s, lanes, p, hit_distance, most);
        for (int k = 0; k < ABREAST; k++)
            retire_close(&p[k], &lanes[k], most, desk);
    }
}

#endif
