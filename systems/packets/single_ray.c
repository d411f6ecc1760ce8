// A ray by itself. The lanes are the children of a node and the solids of a leaf (I. Wald, C.
// Benthin, S. Boulos, "Getting rid of packets", IRT 2008). In a kd-tree the traversal is scalar.
#include "query.h"
#include "solids.h"

// Returns whether (t, shape) comes before (than, whose): the lower index of equal distances.
static inline bool is_nearer(float t, float shape, float than, float whose) {
    return t < than || (t == than && shape < whose);
}

struct single_ray {
    struct vec origin, direction;
    vfloat low[3], high[3], per[3]; // origin, moved on and back by a box's margin; 1/direction
    int near[3];                    // of a node's six arrays: the planes that the ray passes first
    float from, t, shape, excluded;
};

static inline void intersect_solids_single(const struct query *q, enum solid type,
                                           const struct leaf *leaf, struct single_ray *r) {
    const struct solid_arrays *arrays = &q->scene->tree.arrays[type];
    for (int i = 0; i < leaf->count[type]; i += LANES) {
        vmask active = v_mask_first(leaf->count[type] - i);
        int first = leaf->first[type] + i;
        vfloat in, out, t;
        vmask met = solid_interval(type, active, r->origin, r->direction, arrays, first,
                                   LANE_SOLIDS, q->newton, &in, &out);
        if (!v_any(met))
            continue;
        vfloat index = v_load(arrays->index + first);
        met = v_andnot(v_cmp_eq(index, v_splat(r->excluded)), met);
        if (q->occlusion) {
            if (v_any(v_and(met,
                            v_and(v_cmp_lt(in, v_splat(r->t)), v_cmp_gt(out, v_splat(r->from))))))
                r->t = -INFINITY;
            continue;
        }
        met = entry_distance(met, in, out, r->origin, type, arrays, first, LANE_SOLIDS, &t);
        met = v_and(met, v_cmp_ge(v_splat(r->t), t));
        if (!v_any(met))
            continue;
        t = v_select(met, t, v_splat(INFINITY));
        float least = v_reduce_min(t);
        float whose = v_reduce_min(
            v_select(v_and(met, v_cmp_eq(t, v_splat(least))), index, v_splat(INFINITY)));
        if (is_nearer(least, whose, r->t, r->shape)) {
            r->t = least;
            r->shape = whose;
        }
    }
}

static void intersect_leaf_single(const struct query *q, int number, struct single_ray *r) {
    const struct leaf *leaf = &q->scene->tree.leaf[number];
    intersect_solids_single(q, SOLID_SPHERE, leaf, r);
    intersect_solids_single(q, SOLID_BOX, leaf, r);
    intersect_solids_single(q, SOLID_CONE, leaf, r);
}

static void traverse_bvh_single(const struct query *q, struct single_ray *r) {
    const struct tree *tree = &q->scene->tree;
    struct stack_entry stack[STACK_SIZE];
    int count = 0;
    for (int next = 0;;) {
        if (next < 0) {
            intersect_leaf_single(q, -1 - next, r);
            do {
                if (count == 0 || !(r->t > -INFINITY))
                    return;
                count--;
            } while (!(stack[count].begin <= float_max(r->t, 0)));
            next = stack[count].child;
            continue;
        }
        const float *box = tree->boxes + (size_t)next * 6 * LANES;
        vfloat enter = v_splat(0.0f), leave = v_splat(float_max(r->t, 0));
        for (int k = 0; k < 3; k++) {
            const float *near = box + r->near[k],
                        *far = box + 3 * LANES + 2 * k * LANES - r->near[k];
            enter = v_max((v_load(near) - r->low[k]) * r->per[k], enter);
            leave = v_min((v_load(far) - r->high[k]) * r->per[k], leave);
        }
        unsigned which = v_mask_bits(v_cmp_ge(leave * v_splat(1 + 1e-6f), enter));
        const int *child = tree->child + next * LANES;
        if (which && !(which & (which - 1))) { // one child, as for most nodes
            next = child[__builtin_ctz(which)];
            continue;
        }
        count = push_children(stack, count, which, enter, child);
        if (count == 0)
            return;
        next = stack[--count].child;
    }
}

// The part of the ray in a cell is cut at each plane.
static void traverse_kd_single(const struct query *q, struct single_ray *r) {
    const struct tree *tree = &q->scene->tree;
    float o[3] = {v_lane0(r->origin.x), v_lane0(r->origin.y), v_lane0(r->origin.z)};
    float enter = 0, leave = float_max(r->t, 0), low[3], per[3];
    for (int k = 0; k < 3; k++) {
        low[k] = fabsf(v_lane0(r->low[k]) - o[k]);
        per[k] = v_lane0(r->per[k]);
        float a = (tree->bounds.lo[k] - low[k] - o[k]) * per[k],
              b = (tree->bounds.hi[k] + low[k] - o[k]) * per[k];
        enter = float_max(enter, float_min(a, b));
        leave = float_min(leave, float_max(a, b));
    }
    struct {
        int node;
        float enter, leave;
    } stack[MAX_DEPTH];
    int count = 0, number = 0;
    if (!(enter <= leave * (1 + 1e-6f)))
        return;
    for (;;) {
        const struct kd_node *node = &tree->kd[number];
        while (node->axis < 3) {
            int a = node->axis;
            float at = (node->split - o[a]) * per[a], slack = low[a] * fabsf(per[a]);
            // The ray is in child `before` up to `at`, in `behind` from there. Within the margin it
            // may be in both.
            int before = node->below + (per[a] < 0), behind = node->below + !(per[a] < 0);
            if (enter <= at + slack && at - slack <= leave) {
                stack[count].node = behind;
                stack[count].enter = float_max(enter, at - slack);
                stack[count++].leave = leave;
                leave = float_min(leave, at + slack);
                number = before;
            } else {
                number = enter <= at + slack ? before : behind;
            }
            node = &tree->kd[number];
        }
        intersect_leaf_single(q, node->below, r);
        do {
            if (count == 0 || !(r->t > -INFINITY))
                return;
            count--;
        } while (!(stack[count].enter <= float_max(r->t, 0)));
        number = stack[count].node;
        enter = stack[count].enter;
        leave = stack[count].leave;
    }
}

void trace_single_ray(const struct query *q, int i, float margin) {
    const struct ray_batch *b = q->batch;
    float o[3], d[3], square = 0, sum = 0;
    for (int k = 0; k < 3; k++) {
        o[k] = b->origin[k][i];
        d[k] = b->direction[k][i];
        margin += 1e-6f * fabsf(o[k]);
        square += d[k] * d[k];
        sum += fabsf(o[k]) + fabsf(d[k]);
    }
    struct single_ray r; // not zeroed: that costs as much as a node
    r.origin = vec_set(o);
    r.direction = vec_set(d);
    r.from = b->near ? b->near[i] : 0;
    r.t = q->t[i];
    r.shape = q->occlusion ? -1 : q->shape[i];
    r.excluded = b->excluded ? b->excluded[i] : -1;
    if (!(sum < INFINITY && square > 0 && r.t > -INFINITY))
        return; // not finite, or no direction: a miss
    for (int k = 0; k < 3; k++) {
        // A scalar quotient, not one per lane; 0 becomes 1e-20.
        float size = float_max(fabsf(d[k]), 1e-20f);
        bool back = signbit(d[k]);
        r.per[k] = v_splat(1.0f / (back ? -size : size));
        r.near[k] = (back ? 3 + k : k) * LANES;
        r.low[k] = v_splat(back ? o[k] - margin : o[k] + margin);
        r.high[k] = v_splat(back ? o[k] + margin : o[k] - margin);
    }
    if (q->scene->tree.kind == TREE_KD)
        traverse_kd_single(q, &r);
    else if (q->scene->tree.kind == TREE_BVH)
        traverse_bvh_single(q, &r);
    else
        intersect_leaf_single(q, 0, &r);
    q->t[i] = r.t;
    if (!q->occlusion)
        q->shape[i] = r.shape;
}
