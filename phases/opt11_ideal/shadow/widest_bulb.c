// The least ratio of a Mandelbulb for all queued shadow rays. Its estimate has no closed form: steps that no ratio
// below the best can hide in. Some rays take hundreds of them, so ended lanes get other rays.
#include "bulb/bulb_estimate.h"
#include "shadow/bulb_slope.h"
#include "shadow/soft_packet.h"
#include "shadow/widest_cone.h"
#include "types/numerics.h"
#include "types/sdf.h"
#include "types/tile_context.h"

// The share of t by which a ratio may be missed. The estimate falls about as fast as t grows.
#define BULB_ROOM_SHARE (1.0f / 4)

// Rays in the Mandelbulb's frame. `ray`: their numbers in the queue.
struct bulb_search {
    struct vec o, d;
    vfloat t, end, best, ray;
};

enum { SEARCH_REALS = sizeof(struct bulb_search) / sizeof(vfloat) };

// going: rays that take another step. held: rays whose ratio has not been stored.
struct search_packet {
    struct bulb_search at;
    vmask going;
    unsigned held;
};

// Loads a packet of queued rays, from `first` on. A ray begins and ends where a cone of slope `best` enters and leaves
// the bounding sphere: elsewhere the estimate, BULB_SHARE of the way to the sphere or more, is above `best`.
INLINE void load_search(int first, int i, const struct tile_context *work,
                        struct search_packet *to) {
    const struct primitive *s = &KNOWN(work->scene)->primitives[i];
    float (*field)[QUEUE_ROOM] = work->scratch->shadow;
    vmask rays = v_mask_first(int_min(LANES, work->scratch->shadows - first));
    struct vec point = load_vec(field + S_POINT, first), light = vec_set(work->light);
    vmask self = is_shape(v_load(&field[S_SHAPE][first]), i);
    struct vec o = vec_select(self, load_vec(field + S_LOCAL, first), to_local(s, point));
    struct vec d = turned(s, load_vec(field + S_TO_LIGHT, first));
    struct vec l = vec_sub(light, point);
    vfloat zero = v_splat(0.0f), radius = v_splat(s->bound);
    vfloat near = v_splat((float)KNOWN(work->scene)->model.march.surface_offset);
    vfloat best = v_load(&field[S_LIT][first]), q = best * v_splat(1.0f / BULB_SHARE);
    vfloat a = v_nmadd(q, q, v_splat(1.0f)), b = v_msub(q, radius, vec_dot(o, d));
    vfloat c = v_nmadd(radius, radius, vec_dot(o, o)), root = v_msub(b, b, a * c);
    vmask narrow = v_cmp_gt(a, v_splat(1e-3f)), outside = v_cmp_gt(c, zero);
    vmask misses = v_and(outside, v_or(v_cmp_lt(b, zero), v_cmp_lt(root, zero)));
    root = v_sqrt(v_max(root, zero));
    vfloat enters = v_select(v_and(narrow, outside), (b - root) / a, near);
    vfloat leaves = v_select(narrow, (b + root) / a, v_splat(INFINITY));
    vfloat t = v_max(near, enters), end = v_min(vec_norm(l), leaves);
    rays = v_andnot(v_and(narrow, misses), v_and(rays, v_cmp_gt(best, zero)));
    to->going = v_and(rays, v_cmp_lt(t, end));
    to->held = v_mask_bits(to->going);
    to->at = (struct bulb_search){o, d, t, end, best, v_iota() + v_splat((float)first)};
}

// Stores the ratios of rays that have ended, and gives their lanes rays of `ready`, which is loaded from the queue
// whenever it is empty. Returns the next queue index.
INLINE int refill_search(struct search_packet *to, struct search_packet *ready, int next, int i,
                         const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    unsigned ended = ~v_mask_bits(to->going) & ((1u << LANES) - 1);
    float best[LANES], ray[LANES];
    v_store(to->at.best, best);
    v_store(to->at.ray, ray);
    for (unsigned rest = ended & to->held; rest; rest &= rest - 1)
        scratch->shadow[S_LIT][(int)ray[__builtin_ctz(rest)]] = best[__builtin_ctz(rest)];
    to->held &= ~ended;
    while (ended) {
        for (; !ready->held && next < scratch->shadows; next += LANES)
            load_search(next, i, work, ready);
        if (!ready->held)
            break;
        int room = __builtin_popcount(ended), there = __builtin_popcount(ready->held);
        unsigned into = lowest_bits(ended, room < there ? room : there);
        unsigned from = lowest_bits(ready->held, room < there ? room : there);
        v_move_lanes((float *)&to->at, into, (const float *)&ready->at, from, SEARCH_REALS);
        to->held |= into;
        ready->held &= ~from;
        ended &= ~into;
    }
    to->going = v_mask_of_bits(to->held);
    return next;
}

// One step of each packet. Returns the number of rays that go on.
INLINE int step_search(struct search_packet *all, const struct primitive *s, vfloat room) {
    vfloat h[INTERLEAVED], zero = v_splat(0.0f);
    struct vec p[INTERLEAVED];
    vmask done[INTERLEAVED];
    int rays = 0;
    for (int k = 0; k < INTERLEAVED; k++) {
        p[k] = vec_along(all[k].at.o, all[k].at.d, all[k].at.t);
        done[k] = v_not(all[k].going);
    }
    bulbs(s, p, done, false, false, h);
    for (int k = 0; k < INTERLEAVED; k++) {
        struct bulb_search *at = &all[k].at;
        vfloat t = at->t, ratio = v_max(h[k] * quick_inverse(t), zero);
        vmask going = all[k].going;
        at->best = v_select(going, v_min(at->best, ratio), at->best);
        going = v_and(going, v_and(v_cmp_gt(at->best, zero), v_cmp_lt(t, at->end)));
        vfloat goal = at->best - room, slope = search_slope(p[k], s);
        vfloat step = v_nmadd(goal, t, h[k]) * quick_inverse(slope + v_max(goal, zero));
        at->t = v_select(going, v_min(t + v_max(step, v_splat(0x1p-20f) * t), at->end), t);
        all[k].going = going;
        rays += v_count(going);
    }
    return rays;
}

// Lowers the ratios of the queued rays by shape i.
INLINE void search_shape(int i, const struct tile_context *work) {
    float strength = (float)KNOWN(work->scene)->model.shadow_strength;
    vfloat room = v_splat(BULB_ROOM_SHARE / (strength > 1.0f ? strength : 1.0f));
    struct search_packet all[INTERLEAVED + 1]; // the last is ready
    memset(all, 0, sizeof all);
    for (int next = 0;;) {
        int rays = 0;
        for (int k = 0; k < INTERLEAVED; k++) {
            next = refill_search(&all[k], &all[INTERLEAVED], next, i, work);
            rays += __builtin_popcount(all[k].held);
        }
        if (!rays)
            break;
        bool more = next < work->scratch->shadows || all[INTERLEAVED].held;
        int enough = more ? rays - REFILL : 0;
        while (rays > enough)
            rays = step_search(all, &KNOWN(work->scene)->primitives[i], room);
    }
}

void search_bulb(const struct tile_context *work) {
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
        if (KNOWN(work->scene)->primitives[i].type == SHAPE_MANDELBULB)
            search_shape(i, work);
}
