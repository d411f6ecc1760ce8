// Soft shadows without a march: the least h(t)/t between the start of a shadow ray and the light, solid by
// solid. The scene's least ratio is the least over its shapes, in any order.
#include "bvh/bvh_lists.h"
#include "repetition/repeated_rays.h"
#include "shadow/own_solid.h"
#include "shadow/shadow_batch.h"
#include "shadow/shadow_cone.h"
#include "shadow/shadow_rays.h"
#include "shadow/sharp_parts.h"
#include "shadow/soft_packet.h"
#include "shadow/widest_torus.h"
#include "types/sdf.h"
#include "types/tile_context.h"

// The ratio of a plane falls or rises all along.
INLINE void darken_by_plane(int i, struct soft_packet *w, const struct known_scene *scene) {
    const struct primitive *s = &scene->primitives[i];
    vmask self = is_shape(w->shape, i);
    vfloat slope = add_dot(s->normal, w->to_light), zero = v_splat(0.0f);
    vfloat height = v_zero_where(self, height_over(s, w->point));
    vfloat t = v_select(v_cmp_lt(height, zero), w->near, w->far);
    vfloat ratio = v_max(slope + height / t, zero);
    w->best = v_select(w->active, v_min(w->best, ratio), w->best);
}

INLINE void darken_by_solid(int i, struct soft_packet *w, const struct prepared *prepared) {
    const struct known_scene *scene = KNOWN(prepared);
    const struct primitive *s = &scene->primitives[i];
    vmask self = v_and(is_shape(w->shape, i), w->active), others = w->active;
    vmask far_side = v_mask_none();
    if (v_any(self)) {
        vfloat own = own_ratio(s, w->local, turned(s, w->to_light), w->near);
        w->best = v_select(self, v_min(w->best, own), w->best);
        others = v_andnot(self, others);
        if (!s->convex) {
            vfloat square = v_madd(w->local.x, w->local.x, w->local.z * w->local.z);
            far_side = v_and(self, v_cmp_lt(square, v_splat(s->a * s->a)));
        }
    }
    // The solid does not come into a cone of slope `best` if its bounding sphere does not.
    struct vec to = to_centre(s, w->point);
    vfloat along = vec_dot(to, w->to_light), best = w->best;
    vfloat c = vec_dot(to, to) - v_splat(s->bound_sq);
    vfloat b = v_max(v_madd(best, v_splat(s->bound), along), v_splat(0.0f));
    vfloat narrow = v_nmadd(best, best, v_splat(1.0f));
    vmask clear = v_and(v_cmp_lt(b * b, narrow * c), v_cmp_gt(narrow, v_splat(0.0f)));
    vmask met = v_or(v_andnot(clear, others), far_side);
    if (!v_any(met))
        return;
    struct vec zero = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    struct cone_rays r = {turned(s, vec_along(zero, to, v_splat(-1.0f))), turned(s, w->to_light),
                          w->near, w->far};
    vfloat room = v_splat(room_for((float)scene->model.shadow_strength)), where;
    if (s->type == SHAPE_SPHERE) {
        w->best = widest_sphere(&r, s, best, met);
    } else if (s->convex) {
        w->best = widest_convex(&r, s, best, met, room, &where);
    } else {
        r.o = vec_select(far_side, w->local, r.o);
        r.near = v_select(far_side, v_max(r.near, v_splat(NEAR_TUBE * s->b)), r.near);
        met = v_and(met, v_cmp_lt(r.near, r.far));
        w->best = widest_torus(&r, s, best, met, room);
    }
}

INLINE void darken_by_group(const struct primitive *s, int i, struct soft_packet *w, float lit) {
    struct vec zero = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    struct vec o = turned(s, vec_sub(zero, to_centre(s, w->point)));
    o = vec_select(is_shape(w->shape, i), w->local, o);
    struct vec d = turned(s, w->to_light);
    struct soft_packet part = *w;
    vfloat t;
    if (SHARP_OF(s)) { // many rays enter it: closed forms tell them
        vmask dark = sharp_enter(SHARP_OF(s), o, d, w->active, w->near, w->far, &t);
        part.best = w->best = v_select(dark, v_splat(0.0f), w->best);
        part.active = v_and(w->active, v_cmp_gt(w->best, v_splat(0.0f)));
        if (!v_any(part.active))
            return;
        clip_to_parts(s, o, d, &part);
    }
    vfloat found =
        field_widest(FIELD_OF(s), o, d, part.active, part.near, part.far, part.best, lit);
    w->best = v_select(part.active, found, part.best);
}

// A Mandelbulb is searched for all queued rays at once, by search_bulb().
INLINE void darken_by(int i, struct soft_packet *w, const struct prepared *prepared) {
    const struct primitive *s = &KNOWN(prepared)->primitives[i];
    if (!v_any(v_and(w->active, v_cmp_gt(w->best, v_splat(0.0f)))))
        return;
    if (s->eval == EVAL_LINEAR)
        darken_by_plane(i, w, KNOWN(prepared));
    else if (REPEATED(s))
        w->best = widest_in_cells(i, w, room_for((float)KNOWN(prepared)->model.shadow_strength),
                                  prepared);
    else if (IS_GROUP(s))
        darken_by_group(s, i, w, (float)(1.0 / KNOWN(prepared)->model.shadow_strength));
    else if (s->type != SHAPE_MANDELBULB)
        darken_by_solid(i, w, prepared);
}

// Sets how far the rays go, and the ratio of a lit ray.
static void begin_soft_packet(struct soft_packet *w, const struct tile_context *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    struct vec l = vec_sub(vec_set(work->light), w->point);
    w->near = v_splat((float)model->march.surface_offset);
    w->far = vec_norm(l);
    w->active = v_and(w->active, v_cmp_lt(w->near, w->far));
    w->best = v_splat((float)(1.0 / model->shadow_strength));
}

static inline vfloat lit_share(vfloat ratio, const struct tile_context *work) {
    vfloat strength = v_splat((float)KNOWN(work->scene)->model.shadow_strength);
    return v_min(strength * ratio, v_splat(1.0f));
}

// The slope of the first cone in which a packet looks for shapes, and how much wider each further one is: of a crowd, most
// packets find their shadow in the first.
#define FIRST_CONE 0x1p-5f
#define WIDER 16.0f

// Lists in scratch->occluders the shapes that a cone about a ray of the packet can meet: those that the BVH finds for one
// cone about them all. Returns false if the rays are too far apart for that.
static bool list_for_packet(const struct soft_packet *w, vmask rays, float q,
                            const struct tile_context *work) {
    vfloat infinite = v_splat(INFINITY);
    const vfloat at[3] = {w->point.x, w->point.y, w->point.z};
    float low[3], high[3];
    for (int k = 0; k < 3; k++) {
        low[k] = v_reduce_min(v_select(rays, at[k], infinite));
        high[k] = v_reduce_max(v_select(rays, at[k], v_splat(-INFINITY)));
    }
    struct light_bundle bundle;
    if (!light_bundle_of(low, high, work->light, &bundle))
        return false;
    bvh_list_towards_light(&bundle, q, work);
    return true;
}

// Darkens a packet by the listed shapes that are not among `seen`. all: by every shape of the scene.
static void darken_by_new(struct soft_packet *w, bool all, uint64_t seen[],
                          const struct tile_context *work) {
    const struct shape_set *listed = &work->scratch->occluders;
    int count = all ? KNOWN(work->scene)->model.shape_count : set_end(listed);
    for (int k = 0; k < count; k++) {
        int i = all ? k : set_shape(listed, k);
        uint64_t bit = 1ull << i % 64;
        if (seen[i / 64] & bit)
            continue;
        seen[i / 64] |= bit;
        darken_by(i, w, work->scene);
    }
}

// Branch and bound: the shapes of a narrow cone first, then of wider ones, until no ray of the packet has a wider
// cone left. A shape outside of a cone of slope q has no ratio below q.
static void darken_by_listed(struct soft_packet *w, const struct tile_context *work) {
    uint64_t seen[SCENE_MAX_SHAPES / 64];
    memset(seen, 0, sizeof seen);
    vfloat zero = v_splat(0.0f);
    float asked = 0, q = FIRST_CONE;
    for (bool all = false; !all; q *= WIDER) {
        vmask rays = v_and(w->active, v_cmp_gt(w->best, zero));
        if (!v_any(rays))
            return;
        float widest = v_reduce_max(v_select_or_zero(rays, w->best));
        if (widest <= asked)
            return;
        asked = widest < q ? widest : q;
        all = !list_for_packet(w, rays, asked * (1 + 1e-5f), work);
        darken_by_new(w, all, seen, work);
    }
}

static struct vec gather_vec(float field[][QUEUE_ROOM], vindex at) {
    return (struct vec){v_gather(field[0], at), v_gather(field[1], at), v_gather(field[2], at)};
}

// With a BVH. The queue is sorted, so that the rays of a packet are near to each other: by solid, in the BVH's order.
static void cast_sorted(const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    float (*field)[QUEUE_ROOM] = scratch->shadow;
    sort_shadow_rays(scratch, work->scene);
    for (int first = 0; first < scratch->shadows; first += LANES) {
        vmask rays = v_mask_first(int_min(LANES, scratch->shadows - first));
        vindex at = v_index_u16(rays, scratch->order[0] + first);
        struct soft_packet w = {.point = gather_vec(field + S_POINT, at),
                                .local = gather_vec(field + S_LOCAL, at),
                                .to_light = gather_vec(field + S_TO_LIGHT, at),
                                .shape = v_gather(field[S_SHAPE], at),
                                .active = rays};
        begin_soft_packet(&w, work);
        darken_by_listed(&w, work);
        add_light(rays, vec_scale(gather_vec(field + S_LIGHT, at), lit_share(w.best, work)),
                  v_gather(field[S_PIXEL], at), scratch);
    }
}

// Adds the light of the queued rays that begin at `first`, by their ratios.
static inline void add_queued_light(int first, vmask rays, vfloat ratio,
                                    const struct tile_context *work) {
    float (*field)[QUEUE_ROOM] = work->scratch->shadow;
    add_light(rays, vec_scale(load_vec(field + S_LIGHT, first), lit_share(ratio, work)),
              v_load(&field[S_PIXEL][first]), work->scratch);
}

// Then the scene's Mandelbulb, for all packets of the queue.
static inline void cast_to_bulb(const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    search_bulb(work);
    for (int first = 0; first < scratch->shadows; first += LANES)
        add_queued_light(first, v_mask_first(int_min(LANES, scratch->shadows - first)),
                         v_load(&scratch->shadow[S_LIT][first]), work);
}

// All shapes in turn, for the queue's packets as they are.
static inline void cast_in_order(const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    float (*field)[QUEUE_ROOM] = scratch->shadow;
    for (int first = 0; first < scratch->shadows; first += LANES) {
        vmask rays = v_mask_first(int_min(LANES, scratch->shadows - first));
        struct soft_packet w = {.point = load_vec(field + S_POINT, first),
                                .local = load_vec(field + S_LOCAL, first),
                                .to_light = load_vec(field + S_TO_LIGHT, first),
                                .shape = v_load(&field[S_SHAPE][first]),
                                .active = rays};
        begin_soft_packet(&w, work);
        UNROLL_SHAPES
        for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
            darken_by(i, &w, work->scene);
        if (KNOWN(work->scene)->bulbs > 0)
            v_store(w.best, &field[S_LIT][first]);
        else
            add_queued_light(first, rays, w.best, work);
    }
    if (KNOWN(work->scene)->bulbs > 0)
        cast_to_bulb(work);
}

void cast_packets(const struct tile_context *work) {
    if (HAS_BVH(work->scene))
        cast_sorted(work);
    else
        cast_in_order(work);
    work->scratch->shadows = 0;
}
