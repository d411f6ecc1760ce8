// Marches shadow rays in scenes with a Mandelbulb. Some take 1,000 steps, so ended lanes are refilled. Rays
// whose later terms cannot be the least leave for packets of their own.
#include <string.h>

#include "bulb/bulb_estimate.h"
#include "shadow/soft_shadow.h"
#include "types/numerics.h"

static void add_light_to_lane(int i, float lit, struct worker_scratch *scratch) {
    float (*field)[QUEUE_ROOM] = scratch->shadow;
    int pixel = (int)field[S_PIXEL][i];
    for (int k = 0; k < 3; k++)
        scratch->color[k * COLOR_ROOM + pixel] += lit * field[S_LIGHT + k][i];
}

// Lowers h to the distances to shape i.
INLINE void near_bulbs(int i, const struct shadow_march *m, const vmask *done, bool leaving,
                       const struct known_scene *scene, vfloat *h) {
    const struct primitive *s = &scene->primitives[i];
    vfloat distance[INTERLEAVED];
    if (s->type == SHAPE_MANDELBULB) {
        struct vec p[INTERLEAVED];
        for (int k = 0; k < INTERLEAVED; k++)
            p[k] = vec_along(m[k].candidates[i].origin, m[k].candidates[i].direction, m[k].t);
        bulbs(s, p, done, leaving, false, distance);
    } else
        for (int k = 0; k < INTERLEAVED; k++)
            distance[k] = distance_along(&m[k].candidates[i], m[k].t, s);
    for (int k = 0; k < INTERLEAVED; k++)
        h[k] = v_min(h[k], distance[k]);
}

// Sets h to the distance to the nearest shape for INTERLEAVED packets in turns.
__attribute__((always_inline)) static inline void
nearest_bulbs(const struct shadow_march *m, const struct prepared *scene, bool leaving, vfloat *h) {
    vmask done[INTERLEAVED];
    for (int k = 0; k < INTERLEAVED; k++) {
        h[k] = v_splat(INFINITY);
        done[k] = m[k].done;
    }
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(scene)->model.shape_count; i++)
        near_bulbs(i, m, done, leaving, KNOWN(scene), h);
}

// Removes from *behind the rays to which shape i may still come within q·t.
INLINE void keep_behind(int i, const struct shadow_march *m, vfloat q,
                        const struct known_scene *scene, vmask *behind) {
    const struct primitive *s = &scene->primitives[i];
    const struct shadow_candidate *candidate = &m->candidates[i];
    if (!v_any(*behind))
        return;
    if (s->eval == EVAL_LINEAR) {
        *behind = v_and(*behind, v_cmp_ge(candidate->direction.x, q));
        return;
    }
    vfloat share = v_splat(s->type == SHAPE_MANDELBULB ? BULB_SHARE : 1.0f);
    struct vec p = vec_along(candidate->origin, candidate->direction, m->t);
    vfloat square = vec_dot(p, p), per = inverse_root(v_max(square, v_splat(1e-30f)));
    vmask away = v_cmp_ge(share * vec_dot(p, candidate->direction) * per, q);
    vmask far = v_cmp_ge(share * (square * per - v_splat(s->bound)), q * m->t);
    *behind = v_and(*behind, v_and(away, far));
}

// Returns the rays whose later terms cannot be the least: from here on every shape stays at q·t or further,
// for the q at which no term is below 0.866·strength·q.
static inline vmask is_behind_all(const struct shadow_march *m, float per_strength,
                                  const struct prepared *scene) {
    vfloat q = v_sqrt(m->square / m->divisor) * v_splat(per_strength / 0.866f);
    vmask behind = v_not(m->done);
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(scene)->model.shape_count; i++)
        keep_behind(i, m, q, KNOWN(scene), &behind);
    return behind;
}

// A packet whose lanes hold rays of different ages.
struct refilled_packet {
    struct shadow_march march;
    struct shadow_candidate *candidates;
    float ray[LANES];  // index in the queue
    float born[LANES]; // the step count at the start; rays that leave: minus their steps
    float previous[LANES],
        from[LANES]; // rays that leave: values of the march, kept while other lanes go on
    unsigned live, leaving;
};

// Moves as many rays as fit from lanes `here` to lanes `there`, with their candidates: height and slope of a
// plane, or origin and direction (no sphere has `power` beside a Mandelbulb). Returns the lanes that were
// moved.
static unsigned move_rays_to_lanes(struct refilled_packet *to, unsigned there,
                                   const struct refilled_packet *from, unsigned here,
                                   const struct prepared *scene) {
    int a = __builtin_popcount(there), b = __builtin_popcount(here);
    there = lowest_bits(there, a < b ? a : b);
    here = lowest_bits(here, a < b ? a : b);
    size_t march = offsetof(struct refilled_packet, march) + offsetof(struct shadow_march, t);
    v_move_lanes((float *)((char *)to + march), there, (const float *)((const char *)from + march),
                 here, MARCH_REALS);
    for (int k = 0; k < KNOWN(scene)->model.shape_count; k++) {
        float *row = (float *)&to->candidates[k]; // origin and direction
        const float *old = (const float *)&from->candidates[k];
        bool linear = KNOWN(scene)->primitives[k].eval == EVAL_LINEAR;
        v_move_lanes(row, there, old, here, linear ? 1 : 6);
        if (linear)
            v_move_lanes(row + 3 * LANES, there, old + 3 * LANES, here, 1);
    }
    v_move_lanes(to->ray, there, from->ray, here, 1);
    v_move_lanes(to->born, there, from->born, here, 1);
    to->live |= there;
    return here;
}

// Rays darker than DARK_TERM mostly end on a surface, so their march ends early. Their light is the last term
// of such a march, LAST_TERM_SHARE·strength·hit_distance/t: the last distance is between the hit distance and
// about a tenth more. The error is below DARK_TERM; 0 in its place is visible on a display (1.45 % of 8-bit
// values off by more than 1). BEHIND_CHECK_INTERVAL: steps between two calls of is_behind_all().
#define DARK_TERM 0x1p-10f
#define LAST_TERM_SHARE 0.94f // 1.05 in the mean, times √(1 − 0.45²)
enum { BEHIND_CHECK_INTERVAL = 6 };

static void store_bulb_light(const struct refilled_packet *from, unsigned which,
                             const struct tile_context *work) {
    if (!which)
        return;
    float lit[LANES];
    vmask dark = v_cmp_lt(from->march.square, from->march.divisor * v_splat(DARK_TERM * DARK_TERM));
    float last = LAST_TERM_SHARE * (float)KNOWN(work->scene)->model.shadow_strength *
                 (float)work->scene->model.march.hit_distance;
    vfloat all = v_sqrt(from->march.square / from->march.divisor);
    v_store(v_select(dark, v_min(all, v_splat(last) / from->march.t), all), lit);
    for (unsigned rest = which; rest; rest &= rest - 1)
        add_light_to_lane((int)from->ray[__builtin_ctz(rest)], lit[__builtin_ctz(rest)],
                          work->scratch);
}

// Refills ended lanes from `ready`, which is loaded from the queue whenever it is empty. Returns the next
// queue index.
static int refill_shadow_rays(struct refilled_packet *to, struct refilled_packet *ready, int next,
                              int steps, const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    unsigned ended = ~to->live & ((1u << LANES) - 1), all = ended;
    while (ended) {
        while (!ready->live && next < scratch->shadows) {
            struct shadow_rays r;
            load_shadow_packet(scratch->shadow, next, scratch->shadows, &r);
            begin_march(&r, ready->candidates, &scratch->listed[0], work, &ready->march);
            ready->live = v_mask_bits(r.active) & ~v_mask_bits(ready->march.done);
            for (int lane = 0; lane < LANES; lane++)
                ready->ray[lane] = (float)(next + lane);
            // Rays that have left the bounds already; rays that are dark by proof add nothing.
            vmask left = v_and(ready->march.done, v_cmp_gt(ready->march.square, v_splat(0.0f)));
            store_bulb_light(ready, v_mask_bits(r.active) & v_mask_bits(left), work);
            next += LANES;
        }
        if (!ready->live)
            break;
        ready->live &= ~move_rays_to_lanes(to, ended, ready, ready->live, work->scene);
        ended &= ~to->live;
    }
    v_store(v_select(v_mask_of_bits(all & to->live), v_splat((float)steps), v_load(to->born)),
            to->born);
    to->march.done = v_mask_of_bits(~to->live);
    return next;
}

// Packets of shadow rays: INTERLEAVED in work, INTERLEAVED with rays that leave (out), and one that is ready.
struct refilled_packets {
    struct refilled_packet *work, *out, *ready;
    int leaving; // lanes of `out` in use
};

// A Mandelbulb's estimate grows faster than |p| from |p| = e² on. So h may reach 2·previous, where the
// estimator's circles only touch, and a term may be anything. Rays that leave still take those steps for that
// reason, in packets of their own with one iteration each. They end where a plane is nearest for good: beyond
// |p| = 3 the estimate is above 0.33·|p|·ln|p|, whose slope along an outward ray, 0.33·(1 + ln|p|)·cosine,
// only grows. Without a plane they end at the bounds.
INLINE void over_bulb(int i, const struct shadow_march *m, const struct known_scene *scene,
                      vmask *over) {
    const struct shadow_candidate *candidate = &m->candidates[i];
    if (scene->primitives[i].type != SHAPE_MANDELBULB)
        return;
    if (scene->plane < 0) {
        *over = v_mask_none();
        return;
    }
    const struct shadow_candidate *plane = &m->candidates[scene->plane];
    struct vec p = vec_along(candidate->origin, candidate->direction, m->step_began);
    vfloat square = vec_dot(p, p), r = v_sqrt(square), grown = v_log(r);
    vfloat slope = plane->direction.x, height = v_madd(m->step_began, slope, plane->origin.x);
    vmask under = v_cmp_lt(height, r * grown * v_splat(0.33f));
    vmask stays =
        v_cmp_ge(v_madd(grown, v_splat(0.33f), v_splat(0.33f)) * vec_dot(p, candidate->direction),
                 slope * r);
    vmask beyond = v_and(v_cmp_gt(square, v_splat(9.0f)), v_and(under, stays));
    *over = v_and(*over, beyond);
}

static inline vmask plane_is_nearest_for_good(const struct shadow_march *m,
                                              const struct prepared *scene) {
    vmask over = v_mask_all();
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(scene)->model.shape_count; i++)
        over_bulb(i, m, KNOWN(scene), &over);
    return over;
}

static void march_leaving_rays(struct refilled_packets *pools, const struct tile_context *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    vfloat strength = v_splat((float)model->shadow_strength),
           hit = v_splat((float)work->scene->model.march.hit_distance);
    struct shadow_march m[INTERLEAVED];
    int ended = 0;
    for (int k = 0; k < INTERLEAVED; k++) {
        pools->out[k].march.done = v_mask_of_bits(~pools->out[k].live);
        m[k] = pools->out[k].march;
    }
    for (int i = 1; ended < INTERLEAVED * LANES; i++) {
        vfloat oldest = v_splat((float)i - (float)work->scene->model.march.max_steps);
        vfloat h[INTERLEAVED];
        nearest_bulbs(m, work->scene, true, h);
        ended = 0;
        for (int k = 0; k < INTERLEAVED; k++) {
            shadow_step(&m[k], h[k], strength, hit, 0.0f);
            m[k].done = v_or(m[k].done, plane_is_nearest_for_good(&m[k], work->scene));
            m[k].done = v_or(m[k].done, v_cmp_ge(oldest, v_load(pools->out[k].born)));
            ended += v_count(m[k].done);
        }
    }
    for (int k = 0; k < INTERLEAVED; k++) {
        pools->out[k].march = m[k];
        store_bulb_light(&pools->out[k], pools->out[k].live, work);
        pools->out[k].live = 0;
    }
    pools->leaving = 0;
}

static void retire_shadow_rays(struct refilled_packet *from, struct refilled_packets *pools,
                               const struct tile_context *work) {
    unsigned ended = from->live & v_mask_bits(from->march.done), leaving = ended & from->leaving;
    store_bulb_light(from, ended & ~leaving, work);
    from->live &= ~ended;
    from->leaving &= ~ended;
    if (leaving) {
        vmask which = v_mask_of_bits(leaving);
        from->march.previous = v_select(which, v_load(from->previous), from->march.previous);
        from->march.step_began = v_select(which, v_load(from->from), from->march.step_began);
    }
    while (leaving) {
        struct refilled_packet *to = &pools->out[pools->leaving / LANES];
        unsigned room = ~to->live & ((1u << LANES) - 1);
        unsigned moved = move_rays_to_lanes(to, room, from, leaving, work->scene);
        leaving &= ~moved;
        pools->leaving += __builtin_popcount(moved);
        if (pools->leaving == INTERLEAVED * LANES)
            march_leaving_rays(pools, work);
    }
}

// One step of each packet. Returns how many lanes have ended.
static inline int step_refilled(struct shadow_march *m, struct refilled_packet *pool, int steps,
                                const struct tile_context *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    vfloat strength = v_splat((float)model->shadow_strength),
           hit = v_splat((float)work->scene->model.march.hit_distance);
    // Rays older than this have taken all their steps.
    vfloat oldest = v_splat((float)steps - (float)work->scene->model.march.max_steps);
    vfloat h[INTERLEAVED];
    int ended = 0;
    nearest_bulbs(m, work->scene, false, h);
    for (int k = 0; k < INTERLEAVED; k++) {
        vmask behind = v_mask_none();
        if (steps % BEHIND_CHECK_INTERVAL == 0)
            behind = is_behind_all(&m[k], 1.0f / (float)model->shadow_strength, work->scene);
        shadow_step(&m[k], h[k], strength, hit, DARK_TERM * DARK_TERM);
        m[k].done = v_or(m[k].done, v_cmp_ge(oldest, v_load(pool[k].born)));
        behind = v_andnot(m[k].done, behind);
        if (v_any(behind)) {
            vfloat born = v_load(pool[k].born);
            v_store(v_select(behind, born - v_splat((float)steps), born), pool[k].born);
            v_store(v_select(behind, m[k].previous, v_load(pool[k].previous)), pool[k].previous);
            v_store(v_select(behind, m[k].step_began, v_load(pool[k].from)), pool[k].from);
            pool[k].leaving |= v_mask_bits(behind);
            m[k].done = v_or(m[k].done, behind);
        }
        ended += v_count(m[k].done);
    }
    return ended;
}

void cast_streams(const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    const struct known_model *model = &KNOWN(work->scene)->model;
    struct refilled_packet all[REFILLED_PACKETS] = {0};
    memset(scratch->candidates, 0,
           REFILLED_PACKETS * (size_t)model->shape_count * sizeof(struct shadow_candidate));
    for (int k = 0; k < REFILLED_PACKETS; k++)
        all[k].march.candidates = all[k].candidates = scratch->candidates + k * model->shape_count;
    struct refilled_packets pools = {all, all + INTERLEAVED, all + 2 * INTERLEAVED, 0};
    int steps = 0;
    for (int next = 0;;) {
        struct shadow_march m[INTERLEAVED];
        unsigned live = pools.ready->live;
        int ended = 0;
        for (int k = 0; k < INTERLEAVED; k++) {
            next = refill_shadow_rays(&pools.work[k], pools.ready, next, steps, work);
            live |= pools.work[k].live;
            m[k] = pools.work[k].march;
            ended += v_count(m[k].done);
        }
        if (!live)
            break;
        bool more = next < scratch->shadows || pools.ready->live;
        int enough = more ? ended + REFILL : INTERLEAVED * LANES;
        while (ended < enough)
            ended = step_refilled(m, pools.work, ++steps, work);
        for (int k = 0; k < INTERLEAVED; k++) {
            pools.work[k].march = m[k];
            retire_shadow_rays(&pools.work[k], &pools, work);
        }
    }
    if (pools.leaving > 0)
        march_leaving_rays(&pools, work);
    scratch->shadows = 0;
}
