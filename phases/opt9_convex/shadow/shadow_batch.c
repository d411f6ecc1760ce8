// Marches the shadow rays of a scene with a BVH in batches: the queue is sorted (shadow/shadow_sort.c),
// and rays march among the shapes nearby (shadow/active_set.c).
#include "shadow/shadow_batch.h"
#include "bvh/bvh_lists.h"
#include "shadow/soft_shadow.h"

static struct vec load_vec_from(float field[][QUEUE_ROOM], vindex places) {
    return (struct vec){v_gather(field[0], places), v_gather(field[1], places),
                        v_gather(field[2], places)};
}

// Loads the next `count` rays of the sorted queue. Lanes past them get the packet's first ray.
static struct shadow_rays load_sorted_packet(float field[][QUEUE_ROOM], const unsigned short *order,
                                             int count) {
    vmask active = v_mask_first(count);
    vindex at = v_index_u16(active, order);
    return (struct shadow_rays){.active = active,
                                .point = load_vec_from(field + S_POINT, at),
                                .local = load_vec_from(field + S_LOCAL, at),
                                .to_light = load_vec_from(field + S_TO_LIGHT, at),
                                .facing = v_gather(field[S_FACING], at),
                                .shape = v_gather(field[S_SHAPE], at),
                                .end = v_splat(0.0f),
                                .leap_limit = v_splat(INFINITY),
                                .on_plane = v_mask_none(),
                                .meets_one = v_mask_none(),
                                .meets_many = v_mask_none(),
                                .first = v_splat(INFINITY),
                                .cosine = v_splat(1.0f)};
}

// Makes a new active set, ahead of the ray that is furthest behind. Returns whether any ray is left.
static bool renew_active_set(struct shadow_batch *batch, const struct tile_context *work) {
    const struct batch_packet *last = NULL;
    float rear = INFINITY;
    query_ahead(batch, batch->count, work);
    for (int i = 0; i < batch->count; i++) {
        struct batch_packet *w = &batch->packet[i];
        if (v_all(w->march.done))
            continue;
        float t = v_reduce_min(v_select(w->march.done, v_splat(INFINITY), w->march.t));
        if (!last || t < rear) {
            last = w;
            rear = t;
        }
    }
    if (!last)
        return false;
    const struct shadow_march *m = &last->march;
    // Bounds the nearest distance: the ray's own shape is at t or nearer, and a distance grows no faster than
    // t.
    vfloat h = v_min(m->t, m->previous + m->previous);
    set_active_set(batch, last, h, v_andnot(m->done, v_cmp_ge(v_splat(rear), m->t)), work);
    compact_packets(batch, work->scratch);
    set_falling_bounds(batch);
    return true;
}

// Ends the rays with no blocker ahead, and moves the others together.
static void end_and_compact(struct shadow_batch *batch, const struct tile_context *work) {
    query_ahead(batch, batch->moving, work);
    if (compact_packets(batch, work->scratch))
        set_falling_bounds(batch);
}

// One step of all rays within the active set. Returns whether there was any.
static bool active_step(struct shadow_batch *batch, vfloat strength, vfloat hit) {
    bool moves = false;
    active_nearest(batch);
    for (int i = 0; i < batch->moving; i++) {
        struct batch_packet *w = &batch->packet[i];
        struct shadow_march *m = &w->march;
        if (v_all(is_idle(w)))
            continue;
        moves = true;
        // A ray waits if a shape outside the active set could be nearer.
        struct vec off = offset_from_segment(&batch->set, w->at);
        vfloat room = v_splat(batch->set.within) - w->least;
        w->waits = v_or(w->waits, v_not(v_cmp_ge(room * v_abs(room), vec_dot(off, off))));
        vmask still = is_idle(w), done = m->done;
        step_others(m, still, w->least, strength, hit);
        m->done = v_or(done, v_andnot(still, m->done));
    }
    return moves;
}

static void load_batch_packet(struct batch_packet *w, int first, int end,
                              const struct shadow_batch *batch, const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    const float *origin = batch->origin;
    int left = end - first;
    // Fields not set here are set before they are read.
    w->rays =
        load_sorted_packet(scratch->shadow, scratch->order[0] + first, left < LANES ? left : LANES);
    w->waits = v_mask_none();
    // A cone query may come at any distance: this only puts the first one off, for the shape that had the ray
    // queued is mostly further on.
    w->until = v_splat(work->scene->bvh.spacing);
    w->query_slope = v_splat(KNOWN(work->scene)->lit_slope);
    float ray[LANES] = {0};
    for (int i = 0; i < LANES && i < left; i++)
        ray[i] = scratch->order[0][first + i];
    w->ray = v_load(ray);
    int shape = (int)v_lane0(w->rays.shape);
    w->solid = work->scene->primitives[shape].eval == EVAL_LINEAR ? -1 : shape;
    w->local_to =
        w->solid < 0 ? w->rays.to_light : turned(&work->scene->primitives[shape], w->rays.to_light);
    w->start = vec_sub(w->rays.point, vec_set(origin));
}

static void begin_batch_packet(struct batch_packet *w, const struct tile_context *work) {
    begin_march(&w->rays, work->scratch->candidates, &work->scratch->listed[0], work, &w->march);
}

// Adds the light in the order of the sorted queue: the sum does not depend on how rays moved between packets.
static void add_batch_light(int first, int end, struct worker_scratch *scratch) {
    for (int at = first; at < end; at += LANES) {
        const unsigned short *order = scratch->order[0] + at;
        int left = end - at, count = left < LANES ? left : LANES;
        vmask active = v_mask_first(count);
        vindex in = v_index_u16(active, order);
        vfloat lit = v_gather(scratch->shadow[S_LIT], in);
        add_light(active, vec_scale(load_vec_from(scratch->shadow + S_LIGHT, in), lit),
                  v_gather(scratch->shadow[S_PIXEL], in), scratch);
    }
}

static struct light_bundle bundle_of_packets(const struct batch_packet *packet, int packets) {
    struct vec low = packet->rays.point, high = low;
    for (int i = 1; i < packets; i++) {
        struct vec p = packet[i].rays.point;
        low = (struct vec){v_min(low.x, p.x), v_min(low.y, p.y), v_min(low.z, p.z)};
        high = (struct vec){v_max(high.x, p.x), v_max(high.y, p.y), v_max(high.z, p.z)};
    }
    struct vec to = packet->rays.to_light;
    struct light_bundle bundle = {.centre = {0.5f * (v_reduce_min(low.x) + most_lane(high.x)),
                                             0.5f * (v_reduce_min(low.y) + most_lane(high.y)),
                                             0.5f * (v_reduce_min(low.z) + most_lane(high.z))},
                                  .to_light = {v_lane0(to.x), v_lane0(to.y), v_lane0(to.z)}};
    struct vec c = vec_set(bundle.centre), t = vec_set(bundle.to_light);
    vfloat away = v_splat(0.0f), turned = away;
    for (int i = 0; i < packets; i++) {
        struct vec p = packet[i].rays.point, l = packet[i].rays.to_light;
        struct vec v = vec_sub(p, c), d = vec_sub(l, t);
        away = v_max(away, vec_dot(v, v));
        turned = v_max(turned, vec_dot(d, d));
    }
    bundle.radius = sqrtf(most_lane(away)) * (1 + 1e-4f);
    bundle.spread = sqrtf(most_lane(turned)) * 1.01f + 1e-4f;
    return bundle;
}

// Marches the rays from `first` to `end` of the sorted queue and adds their light.
static void cast_batch(int first, int end, const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    const struct model *model = &work->scene->model;
    vfloat strength = v_splat((float)model->shadow_strength),
           hit = v_splat((float)model->march.hit_distance);
    struct shadow_candidate *second = scratch->candidates + model->shape_count;
    struct shadow_batch batch; // not zeroed: load_batch_packet sets the packets
    batch.count = batch.moving = 0;
    batch.set.list = scratch->active_list;
    _Static_assert(2 * sizeof *second >=
                       BATCH_PACKETS * sizeof(struct falling_bound) + sizeof(struct candidate),
                   "room for both");
    _Static_assert(3 * BATCH_PACKETS * sizeof(struct falling_bound) <=
                       BVH_MIN_SHAPES *
                           (2 * sizeof *second - BATCH_PACKETS * sizeof(struct falling_bound)),
                   "awake_candidates() reads three rows behind the last");
    batch.set.below = (struct falling_bound *)second;
    batch.set.shapes =
        (struct candidate *)(batch.set.below + (size_t)model->shape_count * BATCH_PACKETS);
    for (int k = 0; k < 3; k++)
        batch.origin[k] = scratch->shadow[S_POINT + k][scratch->order[0][first]];
    int at = first;
    do // at least one packet
        load_batch_packet(&batch.packet[batch.count++], at, end, &batch, work);
    while ((at += LANES) < end);
    struct light_bundle bundle = bundle_of_packets(batch.packet, batch.count);
    bvh_list_for_batch(&bundle, work);
    for (int i = 0; i < batch.count; i++) {
        bundle = bundle_of_packets(&batch.packet[i], 1);
        bvh_list_for_packet(&bundle, work);
        begin_batch_packet(&batch.packet[i], work);
    }
    // Limits steps and active sets together. An active set in which no ray can step, as with a place that is
    // NaN, counts too, so the loop ends.
    long left = 2L * model->march.max_steps * BATCH_RAYS;
    for (; left > 0 && renew_active_set(&batch, work); left--)
        for (int steps = 1; left > 0 && active_step(&batch, strength, hit); left--, steps++)
            if (steps % CHECK_INTERVAL == 0)
                end_and_compact(&batch, work);
    for (int i = 0; i < batch.count; i++)
        store_lit(&batch.packet[i], batch.packet[i].rays.active, scratch);
    add_batch_light(first, end, scratch);
}

void cast_batches(const struct tile_context *work) {
    work->scratch->entry_list = work->scratch->listed[0].index;
    sort_shadow_rays(work->scratch, work->scene);
    for (int first = 0, end; first < work->scratch->shadows; first = end) {
        end = batch_end(work->scratch, first);
        cast_batch(first, end, work);
    }
    work->scratch->shadows = 0;
}
