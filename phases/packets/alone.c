// A ray by itself: the lanes are the children of a node and the solids of a leaf (I. Wald, C. Benthin, S. Boulos,
// "Getting rid of packets", IRT 2008); through a kd-tree the traversal is scalar, and the lanes are the solids alone.
#include "numerics.h"
#include "query.h"

static inline bool nearer(float t, float shape, float than, float whose) {
    return t < than || (t == than && shape < whose);
}

struct lone {
    struct vec origin, direction;
    vfloat low[3], high[3],
        per[3];  // its origin, moved by what rounding may do to a box; 1/direction
    int near[3]; // of a node's six arrays: the planes that it passes first
    float from, t, shape, own;
};

static inline void solids_alone(const struct query *q, enum solid type, const struct leaf *leaf,
                                struct lone *r) {
    COUNT(solids_alone, call);
    const struct hot *hot = &q->scene->tree.hot[type];
    for (int i = 0; i < leaf->count[type]; i += LANES) {
        vmask active = v_mask_first(leaf->count[type] - i);
        ACTIVE(v_count(active));
        COUNT(solids_alone, group);
        int first = leaf->first[type] + i;
        vfloat in, out, t;
        vmask met = meet(type, active, r->origin, r->direction, hot, first, LANE_SOLIDS, q->newton,
                         &in, &out);
        if (!v_any(met))
            continue;
        COUNT(solids_alone, met);
        vfloat index = v_load(hot->index + first);
        met = v_andnot(v_cmp_eq(index, v_splat(r->own)), met);
        if (q->any) {
            if (v_any(v_and(met,
                            v_and(v_cmp_lt(in, v_splat(r->t)), v_cmp_gt(out, v_splat(r->from))))))
                r->t = -INFINITY;
            continue;
        }
        met = entered(met, in, out, r->origin, type, hot, first, LANE_SOLIDS, &t);
        met = v_and(met, v_cmp_ge(v_splat(r->t), t));
        if (!v_any(met))
            continue;
        t = v_select(met, t, v_splat(INFINITY));
        float least = least_lane(t);
        float whose =
            least_lane(v_select(v_and(met, v_cmp_eq(t, v_splat(least))), index, v_splat(INFINITY)));
        if (nearer(least, whose, r->t, r->shape)) {
            r->t = least;
            r->shape = whose;
        }
    }
}

static void leaf_alone(const struct query *q, int number, struct lone *r) {
    COUNT(leaf_alone, call);
    const struct leaf *leaf = &q->scene->tree.leaf[number];
    solids_alone(q, SOLID_SPHERE, leaf, r);
    solids_alone(q, SOLID_BOX, leaf, r);
    solids_alone(q, SOLID_CONE, leaf, r);
}

static void bvh_alone(const struct query *q, struct lone *r) {
    COUNT(bvh_alone, call);
    const struct tree *tree = &q->scene->tree;
    struct waiting stack[STACK];
    int count = 0;
    for (int next = 0;;) {
        if (next < 0) {
            leaf_alone(q, -1 - next, r);
            do {
                if (count == 0 || !(r->t > -INFINITY))
                    return;
                count--;
            } while (!(stack[count].begin <= larger(r->t, 0)));
            next = stack[count].child;
            continue;
        }
        COUNT(bvh_alone, node);
        const float *box = tree->boxes + (size_t)next * 6 * LANES;
        vfloat enter = v_splat(0.0f), leave = v_splat(larger(r->t, 0));
        for (int k = 0; k < 3; k++) {
            const float *near = box + r->near[k],
                        *far = box + 3 * LANES + 2 * k * LANES - r->near[k];
            enter = v_max((v_load(near) - r->low[k]) * r->per[k], enter);
            leave = v_min((v_load(far) - r->high[k]) * r->per[k], leave);
        }
        unsigned which = v_mask_bits(v_cmp_ge(leave * v_splat(1 + 1e-6f), enter));
        const int *child = tree->child + next * LANES;
        if (which && !(which & (which - 1))) { // one alone, as most are
            next = child[__builtin_ctz(which)];
            continue;
        }
        count = push(stack, count, which, enter, child);
        if (count == 0)
            return;
        next = stack[--count].child;
    }
}

// Scalar, as a kd-tree is: the part of the ray in a cell is cut at each plane.
static void kd_alone(const struct query *q, struct lone *r) {
    COUNT(kd_alone, call);
    const struct tree *tree = &q->scene->tree;
    float o[3] = {v_lane0(r->origin.x), v_lane0(r->origin.y), v_lane0(r->origin.z)};
    float enter = 0, leave = larger(r->t, 0), low[3], per[3];
    for (int k = 0; k < 3; k++) {
        low[k] = fabsf(v_lane0(r->low[k]) - o[k]);
        per[k] = v_lane0(r->per[k]);
        float a = (tree->bounds.lo[k] - low[k] - o[k]) * per[k],
              b = (tree->bounds.hi[k] + low[k] - o[k]) * per[k];
        enter = larger(enter, smaller(a, b));
        leave = smaller(leave, larger(a, b));
    }
    struct {
        int node;
        float enter, leave;
    } stack[MOST_DEPTH];
    int count = 0, number = 0;
    if (!(enter <= leave * (1 + 1e-6f)))
        return;
    for (;;) {
        const struct kd_node *node = &tree->kd[number];
        while (node->axis < 3) {
            COUNT(kd_alone, node);
            int a = node->axis;
            float at = (node->split - o[a]) * per[a], slack = low[a] * fabsf(per[a]);
            // Before `at` the ray is on the side that it comes from, behind it on the other; within what is rounded it
            // may be on either.
            int before = node->below + (per[a] < 0), behind = node->below + !(per[a] < 0);
            if (enter <= at + slack && at - slack <= leave) {
                stack[count].node = behind;
                stack[count].enter = larger(enter, at - slack);
                stack[count++].leave = leave;
                leave = smaller(leave, at + slack);
                number = before;
            } else {
                number = enter <= at + slack ? before : behind;
            }
            node = &tree->kd[number];
        }
        leaf_alone(q, node->below, r);
        do {
            if (count == 0 || !(r->t > -INFINITY))
                return;
            count--;
        } while (!(stack[count].enter <= larger(r->t, 0)));
        number = stack[count].node;
        enter = stack[count].enter;
        leave = stack[count].leave;
    }
}

void go_alone(const struct query *q, int i, float margin) {
    COUNT(go_alone, call);
    const struct beams *b = q->beams;
    float o[3], d[3], square = 0, sum = 0;
    for (int k = 0; k < 3; k++) {
        o[k] = b->origin[k][i];
        d[k] = b->direction[k][i];
        margin += 1e-6f * fabsf(o[k]);
        square += d[k] * d[k];
        sum += fabsf(o[k]) + fabsf(d[k]);
    }
    struct lone r; // not set to 0 first: as much again as a node
    r.origin = vec_set(o);
    r.direction = vec_set(d);
    r.from = b->near ? b->near[i] : 0;
    r.t = q->t[i];
    r.shape = q->any ? -1 : q->shape[i];
    r.own = b->own ? b->own[i] : -1;
    if (!(sum < INFINITY && square > 0 && r.t > -INFINITY))
        return; // not numbers, or no direction: it meets nothing
    for (int k = 0; k < 3; k++) {
        // One quotient, not one in every lane; 0 becomes 1e-20.
        float size = larger(fabsf(d[k]), 1e-20f);
        bool back = signbit(d[k]);
        r.per[k] = v_splat(1.0f / (back ? -size : size));
        r.near[k] = (back ? 3 + k : k) * LANES;
        r.low[k] = v_splat(back ? o[k] - margin : o[k] + margin);
        r.high[k] = v_splat(back ? o[k] + margin : o[k] - margin);
    }
    if (q->scene->tree.kind == TREE_KD)
        kd_alone(q, &r);
    else if (q->scene->tree.kind == TREE_BVH)
        bvh_alone(q, &r);
    else
        leaf_alone(q, 0, &r);
    q->t[i] = r.t;
    if (!q->any)
        q->shape[i] = r.shape;
}
