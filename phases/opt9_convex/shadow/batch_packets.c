// Cone queries for a batch of shadow rays, and the moves of its rays between packets.
#include "bvh/bvh_lists.h"
#include "shadow/shadow_batch.h"

// A ray repeats its cone query once its slope has fallen below this share of the slope of the last query.
#define REQUERY_SLOPE 0.75f

// A packet's cone query: its rays, and the slopes of their cones.
struct ahead {
    struct batch_packet *packet;
    vmask queried;
    vfloat q;
};

// Returns whether any ray needs a cone query: because it has passed the last blocker found, or because its
// least term allows a cone of smaller slope q.
static bool needs_cone_query(struct batch_packet *w, struct ahead *a, float strength) {
    const struct shadow_march *m = &w->march;
    a->packet = w;
    a->q = v_sqrt(m->square / m->divisor) * v_splat(1.0f / (0.866f * strength));
    // q bounds the term of the step to here only if that step began at q·t or further from all shapes.
    vmask queried = v_andnot(m->done, v_cmp_ge(m->previous, a->q * m->step_began));
    a->queried = v_and(queried, v_or(v_cmp_ge(m->t, w->until),
                                     v_cmp_lt(a->q, w->query_slope * v_splat(REQUERY_SLOPE))));
    return v_any(a->queried);
}

// Returns the cones. Where a plane comes into a cone, no query is needed: the plane blocks to the end.
static struct packet_cones cones_of(const struct ahead *a, const struct prepared *scene) {
    const struct batch_packet *w = a->packet;
    const struct shadow_march *m = &w->march;
    // Along a ray from a convex solid, the solid's distance over t never falls. It was q or more where the
    // last step began, so the query leaves the solid out. A ray without a step (step_began is 0) has no such
    // bound.
    bool convex = w->solid >= 0 && scene->primitives[w->solid].convex;
    vfloat excluded = v_select(v_cmp_gt(m->step_began, v_splat(0.0f)),
                               v_splat(convex ? (float)w->solid : -1.0f), v_splat(-1.0f));
    vfloat q = v_min(a->q, v_splat(0.99f)), left = v_nmadd(q, q, v_splat(1.0f));
    vmask blocked = v_mask_none();
    for (int k = 0; k < scene->plane_count; k++) {
        const struct primitive *s = &scene->primitives[scene->planes[k]];
        blocked = v_or(blocked, v_cmp_lt(vec_dot(vec_set(s->normal), w->rays.to_light), q));
    }
    return (struct packet_cones){{w->rays.point, w->rays.to_light, q, left, left * m->t},
                                 m->t,
                                 excluded,
                                 v_select(blocked, v_splat(INFINITY), v_splat(-1.0f)),
                                 v_andnot(blocked, a->queried),
                                 v_mask_none()};
}

// The rays of a batch start close together, on one solid or on planes. Mostly the same shapes block them, so
// one query serves all packets.
void query_ahead(struct shadow_batch *batch, int packets, const struct tile_context *work) {
    _Static_assert((int)BATCH_PACKETS <= (int)QUERY_PACKETS, "one query for a batch");
    struct packet_cones cones[BATCH_PACKETS];
    struct ahead asking[BATCH_PACKETS];
    int count = 0;
    for (int i = 0; i < packets; i++)
        if (!v_all(batch->packet[i].march.done))
            count += needs_cone_query(&batch->packet[i], &asking[count],
                                      (float)work->scene->model.shadow_strength);
    if (!count)
        return;
    for (int i = 0; i < count; i++)
        cones[i] = cones_of(&asking[i], work->scene);
    bvh_cone_query(&work->scene->bvh, cones, count, &work->scratch->far);
    for (int i = 0; i < count; i++) {
        struct batch_packet *w = asking[i].packet;
        vmask queried = asking[i].queried;
        vfloat until = cones[i].until;
        w->march.done = v_or(w->march.done, v_and(queried, v_cmp_lt(until, v_splat(0.0f))));
        w->until = v_select(queried, until, w->until);
        w->query_slope = v_select(queried, asking[i].q, w->query_slope);
    }
}

void store_lit(const struct batch_packet *w, vmask done, struct worker_scratch *scratch) {
    float ray[LANES], lit[LANES];
    v_store(w->ray, ray);
    v_store(v_sqrt(w->march.square / w->march.divisor), lit);
    for (unsigned rest = v_mask_bits(done); rest; rest &= rest - 1)
        scratch->shadow[S_LIT][(int)ray[__builtin_ctz(rest)]] = lit[__builtin_ctz(rest)];
}

// One field of all rays of a batch, and room to write a whole register behind the last.
typedef float rows_of[BATCH_RAYS + LANES];

// The fields that move with a ray stand in three runs in struct batch_packet. Each offset is where a run
// begins; shadow/shadow_batch.h has their lengths.
enum { MARCH_AT = offsetof(struct batch_packet, march) + offsetof(struct shadow_march, t) };
enum { RAYS_AT = offsetof(struct batch_packet, rays) + offsetof(struct shadow_rays, point) };
enum { OWN_AT = offsetof(struct batch_packet, start) };

// `rows` is a constant at each call, so the compiler unrolls the loop.
static inline void pack_rows(vindex first, const struct batch_packet *w, size_t from, int rows,
                             rows_of *to, int at) {
    const vfloat *row = (const vfloat *)((const char *)w + from);
    for (int k = 0; k < rows; k++)
        v_permute_store(first, row[k], &to[k][at]);
}

static void pack_packet(vmask moved, const struct batch_packet *w, rows_of *to, int at) {
    vindex first = v_compress_index(moved);
    pack_rows(first, w, MARCH_AT, MARCH_REALS, to, at);
    pack_rows(first, w, RAYS_AT, RAY_REALS, to + MARCH_REALS, at);
    pack_rows(first, w, OWN_AT, BATCH_REALS, to + MARCH_REALS + RAY_REALS, at);
}

static inline void load_rows(vmask active, struct batch_packet *w, size_t to, int rows,
                             rows_of *from, int at) {
    vfloat *row = (vfloat *)((char *)w + to);
    for (int k = 0; k < rows; k++)
        row[k] = v_select_or_zero(active, v_load(&from[k][at]));
}

static void load_packet(vmask active, struct batch_packet *w, rows_of *from, int at) {
    load_rows(active, w, MARCH_AT, MARCH_REALS, from, at);
    load_rows(active, w, RAYS_AT, RAY_REALS, from + MARCH_REALS, at);
    load_rows(active, w, OWN_AT, BATCH_REALS, from + MARCH_REALS + RAY_REALS, at);
}

bool compact_packets(struct shadow_batch *batch, struct worker_scratch *scratch) {
    int moving = 0, live = 0, packets = 0, at = 0;
    for (int i = 0; i < batch->count; i++) {
        struct batch_packet *w = &batch->packet[i];
        vmask ended = v_and(w->rays.active, w->march.done);
        if (v_any(ended))
            store_lit(w, ended, scratch);
        w->rays.active = v_andnot(ended, w->rays.active);
        vmask here = v_andnot(w->waits, w->rays.active);
        live += v_count(w->rays.active);
        moving += v_count(here);
        packets = v_any(here) ? i + 1 : packets;
    }
    batch->moving = (moving + LANES - 1) / LANES;
    if (batch->moving == packets)
        return false;
    rows_of fields[BATCH_ROWS];
    for (int wait = 0; wait < 2; wait++)
        for (int i = 0; i < batch->count; i++) {
            struct batch_packet *w = &batch->packet[i];
            vmask moved = v_and(w->rays.active, wait ? w->waits : v_not(w->waits));
            if (!v_any(moved))
                continue;
            pack_packet(moved, w, fields, at);
            at += v_count(moved);
        }
    batch->count = (live + LANES - 1) / LANES;
    for (int i = 0; i < batch->count; i++) {
        struct batch_packet *w = &batch->packet[i];
        vmask active = v_mask_first(live - i * LANES); // no field was written past the live rays
        load_packet(active, w, fields, i * LANES);
        w->rays.active = active;
        w->waits = v_not(v_mask_first(moving - i * LANES));
        w->march.done = v_not(w->rays.active);
    }
    return true;
}
