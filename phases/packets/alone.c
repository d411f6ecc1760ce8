// A ray by itself: the lanes are the children of a node and the solids of a leaf (I. Wald, C. Benthin, S. Boulos,
// "Getting rid of packets", IRT 2008); through a kd-tree the traversal is scalar, and the lanes are the solids alone.
#include "query.h"

static inline bool nearer(float t, float shape, float than, float whose) {
    return t < than || (t == than && shape < whose);
}

struct lone {
    struct vec origin, direction;
    real low[3], high[3], per[3]; // its origin, moved by what rounding may do to a box; 1/direction
    int near[3];                  // of a node's six arrays: the planes that it passes first
    float from, t, shape, own;
};

static inline void solids_alone(const struct query *q, enum solid type, const struct leaf *leaf,
                                struct lone *r) {
    COUNT(solids_alone, call);
    const struct hot *hot = &q->scene->tree.hot[type];
    for (int i = 0; i < leaf->count[type]; i += LANES) {
        mask active = first_lanes(leaf->count[type] - i);
        ACTIVE(count_of(active));
        COUNT(solids_alone, group);
        int first = leaf->first[type] + i;
        real in, out, t;
        mask met = meet(type, active, r->origin, r->direction, hot, first, LANE_SOLIDS, q->newton,
                        &in, &out);
        if (!any(met))
            continue;
        COUNT(solids_alone, met);
        real index = load(hot->index + first);
        met = but_not(equal(index, set(r->own)), met);
        if (q->any) {
            if (any(both(met, both(less(in, set(r->t)), greater(out, set(r->from))))))
                r->t = -INFINITY;
            continue;
        }
        met = entered(met, in, out, r->origin, type, hot, first, LANE_SOLIDS, &t);
        met = both(met, not_less(set(r->t), t));
        if (!any(met))
            continue;
        t = choose(met, t, set(INFINITY));
        float least = least_lane(t);
        float whose = least_lane(choose(both(met, equal(t, set(least))), index, set(INFINITY)));
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
        real enter = set(0.0f), leave = set(larger(r->t, 0));
        for (int k = 0; k < 3; k++) {
            const float *near = box + r->near[k],
                        *far = box + 3 * LANES + 2 * k * LANES - r->near[k];
            enter = most_of((load(near) - r->low[k]) * r->per[k], enter);
            leave = least_of((load(far) - r->high[k]) * r->per[k], leave);
        }
        unsigned which = bits(not_less(leave * set(1 + 1e-6f), enter));
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
    float o[3] = {first_of(r->origin.x), first_of(r->origin.y), first_of(r->origin.z)};
    float enter = 0, leave = larger(r->t, 0), low[3], per[3];
    for (int k = 0; k < 3; k++) {
        low[k] = fabsf(first_of(r->low[k]) - o[k]);
        per[k] = first_of(r->per[k]);
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
        r.per[k] = set(1.0f / (back ? -size : size));
        r.near[k] = (back ? 3 + k : k) * LANES;
        r.low[k] = set(back ? o[k] - margin : o[k] + margin);
        r.high[k] = set(back ? o[k] + margin : o[k] - margin);
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
