// A batch of rays through the scene: planes, then the tree. The rays go through the tree together
// where their frustum is narrow, else in parts, at last singly. Where they diverge, the lanes are
// better used for the children of a node and the solids of a leaf (I. Wald, C. Benthin, S. Boulos,
// "Getting rid of packets", IRT 2008).
#include "query.h"
#include "ray_arrays.h"

// A plane is solid below. A ray that starts below hits it at once, at minus its depth.
static void intersect_plane(const struct query *q, int index, int packet, vmask active) {
    const struct primitive *s = &q->scene->primitives[index];
    const struct ray_batch *b = q->batch;
    int first = packet * LANES;
    vfloat zero = v_splat(0.0f), best = v_load(q->t + first);
    struct vec n = vec_set(s->normal), o = load_vec(b->origin, first);
    struct vec d = load_vec(b->direction, first);
    vfloat height = vec_dot(o, n) - v_splat(s->offset), slope = vec_dot(d, n);
    // Finite rays with a direction.
    active = v_and(active, v_cmp_lt(v_abs(vec_dot(o, d)), v_splat(INFINITY)));
    active = v_and(active, v_cmp_gt(vec_dot(d, d), zero));
    if (b->excluded)
        active = v_andnot(v_cmp_eq(v_load(b->excluded + first), v_splat((float)index)), active);
    if (q->occlusion) { // blocked if either end is below
        vfloat near = b->near ? v_load(b->near + first) : zero;
        vmask met = v_or(v_cmp_lt(v_madd(slope, near, height), zero),
                         v_cmp_lt(v_madd(slope, best, height), zero));
        v_store(v_select(v_and(met, active), v_splat(-INFINITY), best), q->t + first);
        return;
    }
    vmask under = v_cmp_lt(height, zero);
    vfloat t = height / (zero - slope);
    t = v_select(under, height, t);
    vmask met = v_and(active, v_or(under, v_cmp_lt(slope, zero)));
    take_nearer(q, first, met, t, v_splat((float)index));
}

// Returns what rounding may move a plane of a box by.
static float box_margin(const struct box *all) {
    float most = 0;
    for (int k = 0; k < 3; k++)
        most = float_max(most, float_max(fabsf(all->lo[k]), fabsf(all->hi[k])));
    return 1e-6f * most;
}

// Rays that diverge are tried again in parts of PART_RAYS, then packet by packet, before each is
// traced singly. Against at most FEW_SOLIDS, packets are tested whatever way their rays go.
enum { PART_RAYS = 64, FEW_SOLIDS = 128 };

// Returns whether all rays are finite and have a direction.
static bool all_rays_valid(const struct ray_batch *b) {
    vmask all = v_mask_first(LANES);
    for (int i = 0; i < b->count; i += LANES) {
        struct vec o = load_vec(b->origin, i), d = load_vec(b->direction, i);
        vfloat square = vec_dot(d, d), size = v_abs(o.x) + v_abs(o.y) + v_abs(o.z);
        vmask ok = v_and(v_cmp_gt(square, v_splat(0)), v_cmp_lt(size + square, v_splat(INFINITY)));
        all = v_and(all, v_or(ok, v_andnot(active_lanes(b, i / LANES), v_mask_first(LANES))));
    }
    return v_mask_bits(all) == v_mask_bits(v_mask_first(LANES));
}

// Traces the `count` rays from `first` on.
static void trace_part(const struct query *whole, int first, int count) {
    const struct ray_batch *b = whole->batch;
    const struct tree *tree = &whole->scene->tree;
    struct ray_batch some = {.count = count};
    struct query q = *whole;
    for (int k = 0; k < 3; k++) {
        some.origin[k] = b->origin[k] + first;
        some.direction[k] = b->direction[k] + first;
    }
    some.near = b->near ? b->near + first : NULL;
    some.far = b->far ? b->far + first : NULL;
    some.excluded = b->excluded ? b->excluded + first : NULL;
    q.batch = &some;
    q.t += first;
    q.shape = q.occlusion ? NULL : q.shape + first;
    enum ray_mode rays = whole->scene->settings.rays;
    if (rays != RAYS_ALONE && trace_bundle(&q, rays == RAYS_TOGETHER))
        return;
    if (rays == RAYS_AUTO && tree_solid_count(tree) <= FEW_SOLIDS && all_rays_valid(&some)) {
        trace_all_solids(&q);
        return;
    }
    int part = count > PART_RAYS ? PART_RAYS : count > LANES ? LANES : 0;
    if (part && rays != RAYS_ALONE) {
        for (int i = 0; i < count; i += part)
            trace_part(&q, i, count - i < part ? count - i : part);
        return;
    }
    float margin = box_margin(&tree->bounds);
    for (int i = 0; i < count; i++)
        trace_single_ray(&q, i, margin);
}

static void trace_batch(const struct query *q) {
    const struct prepared *scene = q->scene;
    const struct ray_batch *b = q->batch;
    for (int k = 0; k < scene->plane_count; k++)
        for (int i = 0; i < b->count; i += LANES)
            intersect_plane(q, scene->planes[k], i / LANES, active_lanes(b, i / LANES));
    if (scene->tree.leaves > 0)
        trace_part(q, 0, b->count);
}

void find_closest_hits(const struct prepared *scene, const struct ray_batch *batch, float *t,
                       float *shape) {
    struct query q = {scene, batch, t, shape, false, scene->settings.newton};
    for (int i = 0; i < batch->count; i += LANES) {
        v_store(v_splat(INFINITY), t + i);
        v_store(v_splat(-1.0f), shape + i);
    }
    trace_batch(&q);
}

void find_occluded(const struct prepared *scene, const struct ray_batch *batch, float *t) {
    struct query q = {scene, batch, t, NULL, true, scene->settings.newton};
    for (int i = 0; i < batch->count; i += LANES)
        v_store(batch->far ? v_load(batch->far + i) : v_splat(INFINITY), t + i);
    trace_batch(&q);
}
