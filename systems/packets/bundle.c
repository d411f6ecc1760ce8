// Bundles: rays of a batch that go the same way traverse the tree together. Their common frustum
// leaves out nodes and solids that no ray can meet; the solids that it meets are tested packet by
// packet (R. Overbeck, R. Ramamoorthi, W. R. Mark, "Large ray packets for real-time Whitted ray
// tracing", IRT 2008). The frustum is by slopes about the main axis (A. Reshetov, A. Soupikov, J.
// Hurley, "Multi-level ray tracing algorithm", SIGGRAPH 2005).
//
// A ray and a solid meet by the same arithmetic as in single_ray.c: hits are equal to the bit.
#include "query.h"
#include "ray_arrays.h"
#include "solids.h"

// What the rays of a bundle have in common: an axis along which all of them go, their slopes about
// it, and where they start.
struct frustum {
    int axis, side[2];       // and the other two axes
    bool back;               // they go along −axis
    float least[2], most[2]; // slopes of `side`
    float lo[3], hi[3];      // of the origins, rounding included
    float max_along;         // most of |direction| along the axis
    float far;               // no ray goes farther
};

// Sets the range of a field over all rays.
static inline void range_of(const struct ray_batch *b, const float *const field, float *lo,
                            float *hi) {
    vfloat least = v_splat(INFINITY), most = v_splat(-INFINITY);
    for (int i = 0; i < b->count; i += LANES) {
        vmask active = active_lanes(b, i / LANES);
        vfloat a = v_load(field + i);
        least = v_select(active, v_min(a, least), least);
        most = v_select(active, v_max(a, most), most);
    }
    *lo = v_reduce_min(least);
    *hi = v_reduce_max(most);
}

// Returns the greatest t of all rays, or 0.
static inline float farthest_hit(const struct query *q) {
    vfloat most = v_splat(-INFINITY);
    for (int i = 0; i < q->batch->count; i += LANES)
        most = v_select(active_lanes(q->batch, i / LANES), v_max(v_load(q->t + i), most), most);
    return float_max(v_reduce_max(most), 0.0f);
}

// A direction's least component along the axis. With less, slopes about it are no narrow bound.
static const float MIN_ALONG_AXIS = 0.2f;

// Sets the frustum of the rays. Returns false if they share no axis, or are not finite.
static bool bundle_frustum(const struct query *q, struct frustum *f) {
    const struct ray_batch *b = q->batch;
    float lo[3], hi[3], best = 0;
    for (int k = 0; k < 3; k++) {
        range_of(b, b->direction[k], &lo[k], &hi[k]);
        float sure = lo[k] > 0 ? lo[k] : -hi[k];
        if (sure > best) {
            best = sure;
            f->axis = k;
        }
    }
    if (best < MIN_ALONG_AXIS)
        return false;
    f->back = !(lo[f->axis] > 0);
    f->max_along = f->back ? -lo[f->axis] : hi[f->axis];
    f->side[0] = (f->axis + 1) % 3;
    f->side[1] = (f->axis + 2) % 3;
    const struct box *all = &q->scene->tree.bounds;
    float margin = 0, apart = 0;
    for (int k = 0; k < 3; k++) {
        range_of(b, b->origin[k], &f->lo[k], &f->hi[k]);
        margin = float_max(margin, float_max(fabsf(f->lo[k]), fabsf(f->hi[k])));
        margin = float_max(margin, float_max(fabsf(all->lo[k]), fabsf(all->hi[k])));
        apart = float_max(apart, f->hi[k] - f->lo[k]);
    }
    margin *= 1e-6f;
    if (!(apart < INFINITY && f->max_along < 2))
        return false;
    vfloat least[2] = {v_splat(INFINITY), v_splat(INFINITY)},
           most[2] = {v_splat(-INFINITY), v_splat(-INFINITY)};
    for (int i = 0; i < b->count; i += LANES) {
        vmask active = active_lanes(b, i / LANES);
        vfloat per = v_splat(1.0f) / v_abs(v_load(b->direction[f->axis] + i));
        for (int k = 0; k < 2; k++) {
            vfloat slope = v_load(b->direction[f->side[k]] + i) * per;
            least[k] = v_select(active, v_min(slope, least[k]), least[k]);
            most[k] = v_select(active, v_max(slope, most[k]), most[k]);
        }
    }
    for (int k = 0; k < 2; k++) {
        f->least[k] = v_reduce_min(least[k]);
        f->most[k] = v_reduce_max(most[k]);
        f->least[k] -= 1e-6f * (1 + fabsf(f->least[k]));
        f->most[k] += 1e-6f * (1 + fabsf(f->most[k]));
    }
    for (int k = 0; k < 3; k++) {
        f->lo[k] -= margin;
        f->hi[k] += margin;
    }
    f->far = farthest_hit(q);
    return true;
}

// Returns how many solids the frustum is expected to hold: their number times its share of the
// tree's box, across its far end.
static float expected_solids(const struct query *q, const struct frustum *f) {
    const struct tree *tree = &q->scene->tree;
    const struct box *all = &tree->bounds;
    int k = f->axis;
    float reach = f->back ? f->hi[k] - all->lo[k] : all->hi[k] - f->lo[k];
    float expected = (float)tree_solid_count(tree);
    for (int side = 0; side < 2; side++) {
        int u = f->side[side];
        float across = (f->most[side] - f->least[side]) * float_max(reach, 0) + f->hi[u] - f->lo[u];
        expected *= float_min(across / float_max(all->hi[u] - all->lo[u], 1e-30f), 1);
    }
    return expected;
}

// Returns the boxes that the frustum meets before `far`, and sets how far along its axis they
// begin.
static inline vmask boxes_in_frustum(const struct frustum *f, const vfloat lo[3],
                                     const vfloat hi[3], vfloat *begin) {
    int k = f->axis;
    vfloat zero = v_splat(0.0f), first, last;
    if (f->back) {
        first = v_splat(f->lo[k]) - hi[k];
        last = v_splat(f->hi[k]) - lo[k];
    } else {
        first = lo[k] - v_splat(f->hi[k]);
        last = hi[k] - v_splat(f->lo[k]);
    }
    first = v_max(first, zero);
    vmask in = v_and(v_cmp_ge(last, zero), v_cmp_ge(v_splat(f->far * f->max_along), first));
    for (int side = 0; side < 2; side++) {
        int u = f->side[side];
        vfloat top = v_max(v_splat(f->most[side]) * first, v_splat(f->most[side]) * last) +
                     v_splat(f->hi[u]);
        vfloat low = v_min(v_splat(f->least[side]) * first, v_splat(f->least[side]) * last) +
                     v_splat(f->lo[u]);
        in = v_and(in, v_and(v_cmp_ge(top, lo[u]), v_cmp_ge(hi[u], low)));
    }
    *begin = first;
    return in;
}

// Tests a packet against solid i of its type.
static inline void intersect_solid(const struct query *q, enum solid type, int i, int packet) {
    const struct ray_batch *b = q->batch;
    vmask active = active_lanes(b, packet);
    const struct solid_arrays *arrays = &q->scene->tree.arrays[type];
    int first = packet * LANES;
    struct vec o = load_vec(b->origin, first);
    vfloat in, out, best = v_load(q->t + first), mine = v_splat(arrays->index[i]);
    struct vec d = load_vec(b->direction, first);
    vmask met = solid_interval(type, active, o, d, arrays, i, LANE_RAYS, q->newton, &in, &out);
    if (!v_any(met))
        return;
    if (b->excluded)
        met = v_andnot(v_cmp_eq(v_load(b->excluded + first), mine), met);
    if (q->occlusion) {
        vfloat near = b->near ? v_load(b->near + first) : v_splat(0.0f);
        met = v_and(met, v_and(v_cmp_lt(in, best), v_cmp_gt(out, near)));
        v_store(v_select(met, v_splat(-INFINITY), best), q->t + first);
        return;
    }
    vfloat t;
    met = entry_distance(met, in, out, o, type, arrays, i, LANE_RAYS, &t);
    take_nearer(q, first, met, t, mine);
}

static inline void intersect_leaf_type(const struct query *q, enum solid type,
                                       const struct leaf *leaf, const struct frustum *f) {
    const struct solid_arrays *arrays = &q->scene->tree.arrays[type];
    int packets = (q->batch->count + LANES - 1) / LANES;
    for (int i = 0; i < leaf->count[type]; i += LANES) {
        int first = leaf->first[type] + i;
        unsigned which = v_mask_bits(v_mask_first(leaf->count[type] - i));
        if (f) {
            vfloat lo[3], hi[3], begin;
            for (int k = 0; k < 3; k++) {
                vfloat centre = v_load(arrays->field[F_CENTRE + k] + first);
                vfloat reach = v_load(arrays->reach[k] + first);
                lo[k] = centre - reach;
                hi[k] = centre + reach;
            }
            which &= v_mask_bits(boxes_in_frustum(f, lo, hi, &begin));
        }
        for (; which; which &= which - 1)
            for (int packet = 0; packet < packets; packet++)
                intersect_solid(q, type, first + __builtin_ctz(which), packet);
    }
}

// Tests all rays against the leaf's solids, but for those outside of the frustum; NULL: against all
// of them.
static void intersect_leaf(const struct query *q, int number, struct frustum *f) {
    const struct leaf *leaf = &q->scene->tree.leaf[number];
    intersect_leaf_type(q, SOLID_SPHERE, leaf, f);
    intersect_leaf_type(q, SOLID_BOX, leaf, f);
    intersect_leaf_type(q, SOLID_CONE, leaf, f);
    if (f)
        f->far = farthest_hit(q);
}

static void traverse_bvh_bundle(const struct query *q, struct frustum *f) {
    const struct tree *tree = &q->scene->tree;
    struct stack_entry stack[STACK_SIZE];
    int count = 1;
    stack[0] = (struct stack_entry){0, 0};
    while (count > 0) {
        struct stack_entry next = stack[--count];
        if (!(next.begin <= f->far * f->max_along))
            continue;
        if (next.child < 0) {
            intersect_leaf(q, -1 - next.child, f);
            continue;
        }
        const float *box = tree->boxes + (size_t)next.child * 6 * LANES;
        vfloat lo[3], hi[3], begin;
        for (int k = 0; k < 3; k++) {
            lo[k] = v_load(box + k * LANES);
            hi[k] = v_load(box + (3 + k) * LANES);
        }
        unsigned which = v_mask_bits(boxes_in_frustum(f, lo, hi, &begin));
        count = push_children(stack, count, which, begin, tree->child + next.child * LANES);
    }
}

static void traverse_kd_bundle(const struct query *q, struct frustum *f) {
    const struct tree *tree = &q->scene->tree;
    struct {
        int node;
        struct box cell;
    } stack[MAX_DEPTH];
    int count = 1;
    stack[0].node = 0;
    stack[0].cell = tree->bounds;
    while (count > 0) {
        int number = stack[--count].node;
        struct box cell = stack[count].cell;
        vfloat lo[3], hi[3], begin;
        for (int k = 0; k < 3; k++) {
            lo[k] = v_splat(cell.lo[k]);
            hi[k] = v_splat(cell.hi[k]);
        }
        if (!v_any(boxes_in_frustum(f, lo, hi, &begin)))
            continue;
        const struct kd_node *node = &tree->kd[number];
        if (node->axis == 3) {
            intersect_leaf(q, node->below, f);
            continue;
        }
        // The side that most rays come from is pushed last.
        int a = node->axis;
        float towards = a == f->axis      ? (f->back ? -1.0f : 1.0f)
                        : a == f->side[0] ? f->least[0] + f->most[0]
                                          : f->least[1] + f->most[1];
        for (int turn = 0; turn < 2; turn++) {
            bool above = (turn == 0) == (towards > 0);
            stack[count].node = node->below + above;
            stack[count].cell = cell;
            (above ? stack[count].cell.lo : stack[count].cell.hi)[a] = node->split;
            count++;
        }
    }
}

static void traverse_bundle(const struct query *q, struct frustum *f) {
    enum tree_kind kind = q->scene->tree.kind;
    if (kind == TREE_BVH)
        traverse_bvh_bundle(q, f);
    else if (kind == TREE_KD)
        traverse_kd_bundle(q, f);
    else
        intersect_leaf(q, 0, NULL);
}

// Rays go together where their frustum is expected to hold at most so many solids: a packet is
// tested against a solid in a 20th of a single ray's time. (A limit on the range of slopes instead
// halves the speed of the shadow rays of 4,096 spheres.)
static const float MAX_EXPECTED = 256;

bool trace_bundle(const struct query *q, bool always) {
    struct frustum f;
    if (!bundle_frustum(q, &f) || !(always || expected_solids(q, &f) <= MAX_EXPECTED))
        return false;
    traverse_bundle(q, &f);
    return true;
}

void trace_all_solids(const struct query *q) {
    for (int leaf = 0; leaf < q->scene->tree.leaves; leaf++)
        intersect_leaf(q, leaf, NULL);
}
