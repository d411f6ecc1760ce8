// Marches of a crowd's shadow rays: sorted by where they are from, then a few packets at a time (shadow/shadow_batch.h).
#include "shadow/shadow_batch.h"
#include "core/numerics.h"
#include "simd/permute.h"

enum { MORTON_BITS = 5, PLANE_CODE = 1 << 15 }; // of each coordinate, in the box of all rays
// The rays of so narrow a box are in one cell of it: the cells' number over the width must be a float.
#define NO_WIDTH 1e-30f
// Steps in a vicinity, or out of a solid, until it is asked which rays have ended.
enum { CHECK_INTERVAL = 6 };
_Static_assert(CHECK_INTERVAL >= 2, "sets_out: no term behind the second is the least");
// A slope that much less than when it was asked what is in the way: asked again.
#define REQUERY_SLOPE 0.75f

// The bits of a and two zeros by turns.
static unsigned spread_bits(unsigned a) {
    unsigned code = 0;
    for (int i = 0; i < MORTON_BITS; i++)
        code |= (a >> i & 1u) << (3 * i);
    return code;
}

// One pass of a sort by digits, which keeps what was equal in its order.
static void sort_by(const unsigned short *code, int shift, int count, const unsigned short *from,
                    unsigned short *to) {
    int first[257] = {0};
    for (int i = 0; i < count; i++)
        first[(code[from[i]] >> shift & 255) + 1]++;
    for (int i = 0; i < 256; i++)
        first[i + 1] += first[i];
    for (int i = 0; i < count; i++)
        to[first[code[from[i]] >> shift & 255]++] = from[i];
}

// Morton's order, of rays from planes (G. M. Morton, "A computer oriented geodetic data base", IBM 1966).
static void morton_codes(struct worker_scratch *scratch, int count) {
    for (int i = 0; i < count; i++)
        scratch->code[i] = 0;
    for (int k = 0; k < 3; k++) {
        const float *x = scratch->shadow[S_POINT + k];
        float least = INFINITY, most = -INFINITY;
        for (int i = 0; i < count; i++) {
            least = x[i] < least ? x[i] : least;
            most = x[i] > most ? x[i] : most;
        }
        float per = most - least > NO_WIDTH ? ((1 << MORTON_BITS) - 0.5f) / (most - least) : 0.0f;
        for (int i = 0; i < count; i++) {
            float place = (x[i] - least) * per;
            unsigned cell = place > 0 ? (unsigned)place : 0; // 0 of what is no number
            scratch->code[i] |= (unsigned short)(spread_bits(cell) << k);
        }
    }
}

// Rays from one solid follow one another, in the tree's order; rays from planes behind them.
static void sort_by_solid(struct worker_scratch *scratch, const struct prepared *scene) {
    int count = scratch->shadows;
    if (scene->plane_count)
        morton_codes(scratch, count);
    for (int i = 0; i < count; i++) {
        int shape = (int)scratch->shadow[S_SHAPE][i];
        bool linear = scene->placed[shape].way == EVAL_LINEAR;
        scratch->code[i] =
            (unsigned short)(linear ? scratch->code[i] | PLANE_CODE : scene->more[shape].bvh_rank);
        scratch->order[0][i] = (unsigned short)i;
    }
    sort_by(scratch->code, 0, count, scratch->order[0], scratch->order[1]);
    sort_by(scratch->code, 8, count, scratch->order[1], scratch->order[0]);
}

static struct vec load_vec_from(float field[][QUEUE_ROOM], vindex places) {
    return (struct vec){v_gather(field[0], places), v_gather(field[1], places),
                        v_gather(field[2], places)};
}

// Rays that have been sorted; in lanes that have none, the packet's first ray.
static struct shadow_rays load_sorted_packet(float field[][QUEUE_ROOM], const unsigned short *order,
                                             int count) {
    COUNT(load_sorted_packet, call);
    vmask active = v_mask_first(count);
    vindex at = v_index_u16(active, order);
    return (struct shadow_rays){.active = active,
                                .point = load_vec_from(field + S_POINT, at),
                                .local = load_vec_from(field + S_LOCAL, at),
                                .to_light = load_vec_from(field + S_TO_LIGHT, at),
                                .facing = v_gather(field[S_FACING], at),
                                .shape = v_gather(field[S_SHAPE], at),
                                .end = v_splat(0.0f),
                                .alone = v_splat(INFINITY),
                                .on_plane = v_mask_none(),
                                .meets_one = v_mask_none(),
                                .meets_many = v_mask_none(),
                                .first = v_splat(INFINITY),
                                .cosine = v_splat(1.0f)};
}

// What is in the way of a ray need not be looked for again until it is behind, or the slope q that the ray's least term so
// far allows is less. Sets those of a packet's rays that must ask; whether any.
static bool needs_cone_query(const struct walk *w, struct cone_request *asking,
                             const struct tile_context *work) {
    const struct shadow_march *m = &w->march;
    ACTIVE(LANES - v_count(m->done));
    COUNT(needs_cone_query, call);
    COUNT(needs_cone_query, scalar);
    vfloat q = v_sqrt(m->square / m->divisor) *
               v_splat(1.0f / (0.866f * (float)work->scene->model.shadow_strength));
    // The term of the step that led here is one of those that q bounds only if that step was as long.
    vmask asked = v_andnot(m->done, v_cmp_ge(m->previous, q * m->from));
    asked = v_and(asked,
                  v_or(v_cmp_ge(m->t, w->until), v_cmp_lt(q, w->asked * v_splat(REQUERY_SLOPE))));
    // The ratio of a convex solid's distance to t never falls along a ray from it, and was q or more where that step began; of
    // a ray that has taken none (`from` is 0) nothing is known.
    bool convex = w->solid >= 0 && work->scene->placed[w->solid].convex;
    vfloat own = v_select(v_cmp_gt(m->from, v_splat(0.0f)),
                          v_splat(convex ? (float)w->solid : -1.0f), v_splat(-1.0f));
    *asking =
        (struct cone_request){.rays = &w->rays, .t = m->t, .q = q, .own = own, .asked = asked};
    return v_any(asked);
}

// Of the first packets of a beam, those rays at once: they are from one solid, or from places on planes that follow each other,
// and what is in their way most often is the same.
// A ray ends where a cone of its slope meets nothing further on.
static void query_ahead(struct shadow_batch *beam, int packets, const struct tile_context *work) {
    COUNT(query_ahead, call);
    struct cone_request asking[BATCH_PACKETS];
    struct walk *of[BATCH_PACKETS];
    int count = 0;
    for (int i = 0; i < packets; i++) {
        struct walk *w = &beam->walk[i];
        if (v_all(w->march.done))
            continue;
        of[count] = w;
        count += needs_cone_query(w, &asking[count], work);
    }
    if (!count)
        return;
    bvh_query_ahead(asking, count, work);
    for (int i = 0; i < count; i++) {
        struct walk *w = of[i];
        const struct cone_request *a = &asking[i];
        ACTIVE(v_count(a->asked));
        COUNT(query_ahead, packet);
        w->march.done = v_or(w->march.done, v_and(a->asked, v_cmp_lt(a->until, v_splat(0.0f))));
        w->until = v_select(a->asked, a->until, w->until);
        w->asked = v_select(a->asked, a->q, w->asked);
    }
}

static void store_lit(const struct walk *w, vmask done, struct worker_scratch *scratch) {
    ACTIVE(v_count(done));
    COUNT(store_lit, call);
    float ray[LANES], lit[LANES];
    v_store(w->ray, ray);
    v_store(v_sqrt(w->march.square / w->march.divisor), lit);
    for (unsigned rest = v_mask_bits(done); rest; rest &= rest - 1)
        scratch->shadow[S_LIT][(int)ray[__builtin_ctz(rest)]] = lit[__builtin_ctz(rest)];
}

typedef float rows_of[BATCH_RAYS + LANES];

// Some of a packet's reals, one behind the other: offset and number of those that a ray takes with it (shadow/shadow_batch.h).
enum { MARCH_AT = offsetof(struct walk, march) + offsetof(struct shadow_march, t) };
enum { RAYS_AT = offsetof(struct walk, rays) + offsetof(struct shadow_rays, point) };
enum { OWN_AT = offsetof(struct walk, from) };

// Loops of constant ends, so that they are unrolled: no branch for each row.
static inline void pack_rows(vindex first, const struct walk *w, size_t from, int rows, rows_of *to,
                             int at) {
    const vfloat *row = (const vfloat *)((const char *)w + from);
    for (int k = 0; k < rows; k++)
        v_permute_store(first, row[k], &to[k][at]);
}

static void pack_packet(vmask those, const struct walk *w, rows_of *to, int at) {
    vindex first = v_compress_index(those);
    pack_rows(first, w, MARCH_AT, MARCH_REALS, to, at);
    pack_rows(first, w, RAYS_AT, RAY_REALS, to + MARCH_REALS, at);
    pack_rows(first, w, OWN_AT, BATCH_REALS, to + MARCH_REALS + RAY_REALS, at);
}

static inline void load_rows(vmask active, struct walk *w, size_t to, int rows, rows_of *from,
                             int at) {
    vfloat *row = (vfloat *)((char *)w + to);
    for (int k = 0; k < rows; k++)
        row[k] = v_select_or_zero(active, v_load(&from[k][at]));
}

static void load_packet(vmask active, struct walk *w, rows_of *from, int at) {
    load_rows(active, w, MARCH_AT, MARCH_REALS, from, at);
    load_rows(active, w, RAYS_AT, RAY_REALS, from + MARCH_REALS, at);
    load_rows(active, w, OWN_AT, BATCH_REALS, from + MARCH_REALS + RAY_REALS, at);
}

// Into as few packets as hold them: those that are marched first, then those that wait. What has ended is left out. Whether
// any ray has another place now.
static bool compact_packets(struct shadow_batch *beam, struct worker_scratch *scratch) {
    int moving = 0, live = 0, packets = 0, at = 0;
    for (int i = 0; i < beam->count; i++) {
        struct walk *w = &beam->walk[i];
        vmask ended = v_and(w->rays.active, w->march.done);
        if (v_any(ended))
            store_lit(w, ended, scratch);
        w->rays.active = v_andnot(ended, w->rays.active);
        vmask here = v_andnot(w->waits, w->rays.active);
        live += v_count(w->rays.active);
        moving += v_count(here);
        packets = v_any(here) ? i + 1 : packets;
    }
    beam->moving = (moving + LANES - 1) / LANES;
    if (beam->moving == packets)
        return false;
    rows_of fields[BATCH_ROWS];
    for (int wait = 0; wait < 2; wait++)
        for (int i = 0; i < beam->count; i++) {
            struct walk *w = &beam->walk[i];
            vmask those = v_and(w->rays.active, wait ? w->waits : v_not(w->waits));
            if (!v_any(those))
                continue;
            pack_packet(those, w, fields, at);
            at += v_count(those);
        }
    beam->count = (live + LANES - 1) / LANES;
    for (int i = 0; i < beam->count; i++) {
        struct walk *w = &beam->walk[i];
        vmask active = v_mask_first(live - i * LANES); // behind them nothing was written
        load_packet(active, w, fields, i * LANES);
        w->rays.active = active;
        w->waits = v_not(v_mask_first(moving - i * LANES));
        w->march.done = v_not(w->rays.active);
    }
    return true;
}

// A new vicinity, where the ray is that is behind all others; whether there is any.
static bool renew_active_set(struct shadow_batch *beam, const struct tile_context *work) {
    COUNT(renew_active_set, call);
    const struct walk *last = NULL;
    float rear = INFINITY;
    query_ahead(beam, beam->count, work);
    for (int i = 0; i < beam->count; i++) {
        struct walk *w = &beam->walk[i];
        if (v_all(w->march.done))
            continue;
        ACTIVE(LANES - v_count(w->march.done));
        COUNT(renew_active_set, packet);
        float t = least_lane(v_select(w->march.done, v_splat(INFINITY), w->march.t));
        if (!last || t < rear) {
            last = w;
            rear = t;
        }
    }
    if (!last)
        return false;
    const struct shadow_march *m = &last->march;
    ACTIVE(LANES - v_count(m->done));
    COUNT(renew_active_set, last);
    // Its own shape is no further than t, and no distance grows faster than a ray goes.
    vfloat h = v_min(m->t, m->previous + m->previous);
    set_active_set(beam, last, h, v_andnot(m->done, v_cmp_ge(v_splat(rear), m->t)), work);
    compact_packets(beam, work->scratch);
    set_falling_bounds(beam);
    return true;
}

// One step of all rays but those that stand still. `told`: no term of it can be the least.
static inline void step_others(struct shadow_march *m, vmask still, vfloat h, vfloat strength,
                               vfloat hit, bool told) {
    vfloat previous = m->previous, from = m->from;
    m->done = still;
    ACTIVE(LANES - v_count(still));
    if (told)
        advance_by(m, h, off_surfaces(m, h, hit));
    else
        shadow_step(m, h, strength, hit, 0.0f);
    m->previous = v_select(still, previous, m->previous);
    m->from = v_select(still, from, m->from);
}

// Ends those that nothing is in the way of, and brings the others together.
static void end_and_compact(struct shadow_batch *beam, const struct tile_context *work) {
    query_ahead(beam, beam->moving, work);
    if (compact_packets(beam, work->scratch))
        set_falling_bounds(beam);
}

// The first steps of a packet's rays, as long as no other shape can be as near as the solid that they are from: from its
// position no other's bounding sphere is nearer than `alone`.
struct solid_exit {
    struct shadow_candidate near;
    const struct primitive *solid;
    vfloat alone;
    vmask still, done;
    bool told; // no term from here on can be the least
};

// Whether they are from a solid, and any is to be marched. `begun`: they have taken CHECK_INTERVAL steps. From what is convex the first
// two have the least of all terms (NOTES.md, 2.).
static bool begin_solid_exit(struct walk *w, struct solid_exit *l, bool begun,
                             const struct tile_context *work) {
    COUNT(begin_solid_exit, call);
    const struct prepared *scene = work->scene;
    if (w->solid < 0 || v_all(is_idle(w)))
        return false;
    ACTIVE(LANES - v_count(is_idle(w)));
    COUNT(begin_solid_exit, solid);
    const struct primitive *s = &scene->placed[w->solid];
    w->local_to = turned(s, w->rays.to_light);
    set_candidate_ray(&w->rays, w->solid, &l->near, work);
    l->solid = s;
    l->alone = v_splat(scene->more[w->solid].alone * (1 - 1e-5f) -
                       1e-6f * (float)scene->model.march.bounds_radius);
    l->still = is_idle(w);
    l->done = w->march.done;
    l->told = begun && s->convex && scene->plane_count == 0;
    return true;
}

// The solid's distance, and how far its position is, squared.
static inline vfloat distance_of_own_solid(const struct solid_exit *l, vfloat t, vfloat *square) {
    COUNT(distance_of_own_solid, call);
    const struct shadow_candidate *n = &l->near;
    if (n->power) { // a sphere, see distance_along: the root of the square is in it
        COUNT(distance_of_own_solid, power);
        vfloat power = v_madd(t, t + n->slope, n->constant);
        *square = v_max(power + v_splat(l->solid->bound_sq), v_splat(0.0f));
        return power / (v_sqrt(*square) + v_splat(l->solid->a));
    }
    COUNT(distance_of_own_solid, point);
    struct vec p = vec_along(n->origin, n->direction, t);
    *square = vec_dot(p, p);
    return distance_at(p, l->solid, v_mask_none());
}

// One step, if any ray can take it: whether one did.
static bool solid_exit_step(struct walk *w, struct solid_exit *l, vfloat strength, vfloat hit,
                            const struct prepared *scene) {
    ACTIVE(LANES - v_count(l->still));
    COUNT(solid_exit_step, call);
    struct shadow_march *m = &w->march;
    vfloat square, h = distance_of_own_solid(l, m->t, &square), room = l->alone - h;
    vmask sure = v_and(v_cmp_gt(room, v_splat(0.0f)), v_cmp_lt(square, room * room));
    vmask still = v_or(l->still, v_not(sure));
    if (v_all(still))
        return false;
    for (int k = 0; k < scene->plane_count; k++) {
        COUNT(solid_exit_step, plane);
        h = v_min(h, plane_height(&scene->placed[scene->planes[k]], v_mask_none(), w));
    }
    step_others(m, still, h, strength, hit, l->told);
    l->done = v_or(l->done, v_andnot(still, m->done));
    l->still = v_or(still, m->done);
    return true;
}

// So many steps at most, of all packets by turns: a step waits for its root, and for the one before it. Whether any packet
// took the last of them; rays that cannot go on wait.
static bool solid_exit_steps(struct shadow_batch *beam, int steps, bool begun, vfloat strength,
                             vfloat hit, const struct tile_context *work) {
    struct solid_exit packets[BATCH_PACKETS];
    unsigned out = 0;
    for (int i = 0; i < beam->moving; i++)
        out |= (unsigned)begin_solid_exit(&beam->walk[i], &packets[i], begun, work) << i;
    unsigned open = out;
    for (; open && steps > 0; steps--)
        for (unsigned rest = open; rest; rest &= rest - 1) {
            int i = __builtin_ctz(rest);
            if (!solid_exit_step(&beam->walk[i], &packets[i], strength, hit, work->scene))
                open &= ~(1u << i);
        }
    for (unsigned rest = out; rest; rest &= rest - 1) {
        int i = __builtin_ctz(rest);
        beam->walk[i].waits = open >> i & 1 ? packets[i].still : v_mask_all();
        beam->walk[i].march.done = packets[i].done;
    }
    return open;
}

// Rays that graze a round solid take hundreds of steps to leave it, a few rays of each packet: those that nothing further on
// can darken any more end before that, and the others are brought together.
static void leave_own_solid(struct shadow_batch *beam, vfloat strength, vfloat hit,
                            const struct tile_context *work) {
    int most = work->scene->model.march.max_steps;
    beam->moving = beam->count;
    if (!solid_exit_steps(beam, int_min(most, CHECK_INTERVAL), false, strength, hit, work))
        return;
    query_ahead(beam, beam->count, work);
    compact_packets(beam, work->scratch);
    solid_exit_steps(beam, most - CHECK_INTERVAL, true, strength, hit, work);
}

// A step of all rays in the vicinity; whether there are any.
static bool active_step(struct shadow_batch *beam, vfloat strength, vfloat hit) {
    COUNT(active_step, call);
    bool moves = false;
    active_nearest(beam);
    for (int i = 0; i < beam->moving; i++) {
        struct walk *w = &beam->walk[i];
        struct shadow_march *m = &w->march;
        if (v_all(is_idle(w)))
            continue;
        ACTIVE(LANES - v_count(is_idle(w)));
        COUNT(active_step, step);
        moves = true;
        // What is not in the vicinity could be nearer.
        struct vec off = offset_from_stretch(&beam->near, w->at);
        vfloat room = v_splat(beam->near.within) - w->least;
        w->waits = v_or(w->waits, v_not(v_cmp_ge(room * v_abs(room), vec_dot(off, off))));
        vmask still = is_idle(w), done = m->done;
        step_others(m, still, w->least, strength, hit, false);
        m->done = v_or(done, v_andnot(still, m->done));
    }
    return moves;
}

static void load_batch_packet(struct walk *w, int first, int end, const struct shadow_batch *beam,
                              const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    const float *place = beam->place;
    int left = end - first;
    ACTIVE(left < LANES ? left : LANES);
    COUNT(load_batch_packet, call);
    // What is not set here is before it is read.
    w->rays =
        load_sorted_packet(scratch->shadow, scratch->order[0] + first, left < LANES ? left : LANES);
    w->waits = v_mask_none();
    // What was in the way of its cone of slope lit_slope, or it were no ray to march, most often is not that near.
    w->until = v_splat(work->scene->tree.spacing);
    w->asked = v_splat(KNOWN(work->scene)->lit_slope);
    float ray[LANES] = {0};
    for (int i = 0; i < LANES && i < left; i++)
        ray[i] = scratch->order[0][first + i];
    w->ray = v_load(ray);
    int shape = (int)v_lane0(w->rays.shape);
    w->solid = work->scene->placed[shape].way == EVAL_LINEAR ? -1 : shape;
    w->local_to = w->rays.to_light;
    w->from = (struct vec){w->rays.point.x - v_splat(place[0]), w->rays.point.y - v_splat(place[1]),
                           w->rays.point.z - v_splat(place[2])};
}

static void begin_batch_packet(struct walk *w, const struct tile_context *work) {
    begin_march(&w->rays, work->scratch->near, &work->scratch->candidates[0], work, &w->march);
}

// In the order of the queue, whatever the packets were.
static void add_batch_light(int first, int end, struct worker_scratch *scratch) {
    COUNT(add_batch_light, call);
    for (int at = first; at < end; at += LANES) {
        const unsigned short *order = scratch->order[0] + at;
        int left = end - at, count = left < LANES ? left : LANES;
        ACTIVE(count);
        COUNT(add_batch_light, packet);
        vmask active = v_mask_first(count);
        vindex in = v_index_u16(active, order);
        vfloat lit = v_gather(scratch->shadow[S_LIT], in);
        add_light(active, vec_scale(load_vec_from(scratch->shadow + S_LIGHT, in), lit),
                  v_gather(scratch->shadow[S_PIXEL], in), scratch);
    }
}

// Of some packets: a ball that their rays start in, and how far they turn from the first one's direction.
struct ray_bundle {
    float centre[3], to_light[3], radius, spread;
};

static struct ray_bundle bundle_of_packets(const struct walk *walk, int packets) {
    ACTIVE(v_count(walk->rays.active));
    COUNT(bundle_of_packets, call);
    COUNT(bundle_of_packets, scalar);
    struct vec low = walk->rays.point, high = low;
    for (int i = 1; i < packets; i++) {
        ACTIVE(v_count(walk[i].rays.active));
        COUNT(bundle_of_packets, box);
        struct vec p = walk[i].rays.point;
        low = (struct vec){v_min(low.x, p.x), v_min(low.y, p.y), v_min(low.z, p.z)};
        high = (struct vec){v_max(high.x, p.x), v_max(high.y, p.y), v_max(high.z, p.z)};
    }
    struct vec to = walk->rays.to_light;
    struct ray_bundle bundle = {{0.5f * (least_lane(low.x) + most_lane(high.x)),
                                 0.5f * (least_lane(low.y) + most_lane(high.y)),
                                 0.5f * (least_lane(low.z) + most_lane(high.z))},
                                {v_lane0(to.x), v_lane0(to.y), v_lane0(to.z)},
                                0,
                                0};
    struct vec c = vec_set(bundle.centre), t = vec_set(bundle.to_light);
    vfloat away = v_splat(0.0f), turned = away;
    for (int i = 0; i < packets; i++) {
        ACTIVE(v_count(walk[i].rays.active));
        COUNT(bundle_of_packets, packet);
        struct vec p = walk[i].rays.point, l = walk[i].rays.to_light;
        struct vec v = {p.x - c.x, p.y - c.y, p.z - c.z}, d = {l.x - t.x, l.y - t.y, l.z - t.z};
        away = v_max(away, vec_dot(v, v));
        turned = v_max(turned, vec_dot(d, d));
    }
    bundle.radius = sqrtf(most_lane(away)) * (1 + 1e-4f);
    bundle.spread = sqrtf(most_lane(turned)) * 1.01f + 1e-4f;
    return bundle;
}

// `first`, `end`: of the sorted queue.
static void cast_batch(int first, int end, const struct tile_context *work) {
    COUNT(cast_batch, call);
    struct worker_scratch *scratch = work->scratch;
    const struct model *model = &work->scene->model;
    vfloat strength = v_splat((float)model->shadow_strength),
           hit = v_splat((float)model->march.hit_distance);
    struct shadow_candidate *second = scratch->near + model->shape_count;
    struct shadow_batch beam; // not zeroed: walks begin below
    beam.count = beam.moving = 0;
    beam.near.list = scratch->active_list;
    _Static_assert(2 * sizeof *second >=
                       BATCH_PACKETS * sizeof(struct falling_bound) + sizeof(struct candidate),
                   "room for both");
    _Static_assert(3 * BATCH_PACKETS * sizeof(struct falling_bound) <=
                       BVH_MIN_SHAPES *
                           (2 * sizeof *second - BATCH_PACKETS * sizeof(struct falling_bound)),
                   "wake() reads three rows behind the last");
    beam.near.below = (struct falling_bound *)second;
    beam.near.shapes =
        (struct candidate *)(beam.near.below + (size_t)model->shape_count * BATCH_PACKETS);
    for (int k = 0; k < 3; k++)
        beam.place[k] = scratch->shadow[S_POINT + k][scratch->order[0][first]];
    int at = first;
    do // one at least
        load_batch_packet(&beam.walk[beam.count++], at, end, &beam, work);
    while ((at += LANES) < end);
    struct ray_bundle bundle = bundle_of_packets(beam.walk, beam.count);
    bvh_list_for_batch(bundle.centre, bundle.radius, bundle.to_light, bundle.spread, work);
    for (int i = 0; i < beam.count; i++) {
        bundle = bundle_of_packets(&beam.walk[i], 1);
        bvh_list_for_packet(bundle.centre, bundle.radius, bundle.to_light, bundle.spread, work);
        begin_batch_packet(&beam.walk[i], work);
    }
    leave_own_solid(&beam, strength, hit, work);
    // Steps, and looks: one that no step comes of, as of a place that is no number, is taken as often as the rays may step
    // at most, twice, and not for ever.
    long left = 2L * model->march.max_steps * BATCH_RAYS;
    for (; left > 0 && renew_active_set(&beam, work); left--)
        for (int steps = 1; left > 0 && active_step(&beam, strength, hit); left--, steps++)
            if (steps % CHECK_INTERVAL == 0)
                end_and_compact(&beam, work);
    for (int i = 0; i < beam.count; i++)
        store_lit(&beam.walk[i], beam.walk[i].rays.active, scratch);
    add_batch_light(first, end, scratch);
}

// Where the beam ends that begins there. Rays from one solid stay as close as it is wide; with the next one's some would wait
// wherever the others are marched (HISTORY.md). walk.solid rests on it.
static int batch_end(const struct worker_scratch *scratch, int first) {
    const unsigned short *order = scratch->order[0];
    int end = first + 1, most = int_min(scratch->shadows, first + BATCH_RAYS);
    unsigned code = scratch->code[order[first]];
    if (code & PLANE_CODE)
        return most;
    while (end < most && scratch->code[order[end]] == code)
        end++;
    return end;
}

void cast_batches(const struct tile_context *work) {
    work->scratch->ahead = work->scratch->candidates[0].index;
    sort_by_solid(work->scratch, work->scene);
    for (int first = 0, end; first < work->scratch->shadows; first = end) {
        end = batch_end(work->scratch, first);
        cast_batch(first, end, work);
    }
    work->scratch->shadows = 0;
}
