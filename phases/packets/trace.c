// Rays through a tree. Rays that go the same way go together: what of the tree and of a leaf's solids their common
// frustum misses is left out for all of them, the rest is tested packet by packet (R. Overbeck, R. Ramamoorthi,
// W. R. Mark, "Large ray packets for real-time Whitted ray tracing", IRT 2008; the frustum by slopes about the main
// axis: A. Reshetov, A. Soupikov, J. Hurley, "Multi-level ray tracing algorithm", SIGGRAPH 2005). Where they diverge
// each ray goes alone, and the lanes are the children of a node and the solids of a leaf (I. Wald, C. Benthin,
// S. Boulos, "Getting rid of packets", IRT 2008).
//
// A ray and a solid are the same arithmetic whichever way they come together, so that the hits are, to the bit.
#include "frustum.h"

// --- Planes, unbounded: packet by packet.

static void ask_plane(const struct query *q, int index, int packet, vmask active) {
    COUNT(ask_plane, call);
    const struct placed *s = &q->scene->placed[index];
    const struct beams *b = q->beams;
    int first = packet * LANES;
    vfloat zero = v_splat(0.0f), best = v_load(q->t + first);
    struct vec n = vec_set(s->normal), o = load_vec(b->origin, first);
    struct vec d = load_vec(b->direction, first);
    vfloat height = vec_dot(o, n) - v_splat(s->offset), slope = vec_dot(d, n);
    active = v_and(active,
                   v_cmp_lt(v_abs(vec_dot(o, d)), v_splat(INFINITY))); // numbers, and a direction
    active = v_and(active, v_cmp_gt(vec_dot(d, d), zero));
    if (b->own)
        active = v_andnot(v_cmp_eq(v_load(b->own + first), v_splat((float)index)), active);
    if (q->any) { // solid below: at either end it is in the way
        COUNT(ask_plane, any);
        vfloat near = b->near ? v_load(b->near + first) : zero;
        vmask met = v_or(v_cmp_lt(v_madd(slope, near, height), zero),
                         v_cmp_lt(v_madd(slope, best, height), zero));
        v_store(v_select(v_and(met, active), v_splat(-INFINITY), best), q->t + first);
        return;
    }
    COUNT(ask_plane, first);
    vmask under = v_cmp_lt(height, zero);
    vfloat t = height / (zero - slope);
    t = v_select(under, height, t);
    vmask met = v_and(active, v_or(under, v_cmp_lt(slope, zero)));
    vfloat shape = v_load(q->shape + first), mine = v_splat((float)index);
    met = v_and(met, v_or(v_cmp_lt(t, best), v_and(v_cmp_eq(t, best), v_cmp_lt(mine, shape))));
    v_store(v_select(met, t, best), q->t + first);
    v_store(v_select(met, mine, shape), q->shape + first);
}

// --- Together

static inline void ask_solid(const struct query *q, enum solid type, int i, int packet) {
    const struct beams *b = q->beams;
    vmask active = active_in(b, packet);
    ACTIVE(v_count(active));
    COUNT(ask_solid, call);
    const struct hot *hot = &q->scene->tree.hot[type];
    int first = packet * LANES;
    struct vec o = load_vec(b->origin, first);
    vfloat in, out, best = v_load(q->t + first), mine = v_splat(hot->index[i]);
    struct vec d = load_vec(b->direction, first);
    vmask met = meet(type, active, o, d, hot, i, LANE_RAYS, q->newton, &in, &out);
    if (!v_any(met))
        return;
    COUNT(ask_solid, met);
    if (b->own)
        met = v_andnot(v_cmp_eq(v_load(b->own + first), mine), met);
    if (q->any) {
        vfloat near = b->near ? v_load(b->near + first) : v_splat(0.0f);
        met = v_and(met, v_and(v_cmp_lt(in, best), v_cmp_gt(out, near)));
        v_store(v_select(met, v_splat(-INFINITY), best), q->t + first);
        return;
    }
    vfloat t, shape = v_load(q->shape + first);
    met = entered(met, in, out, o, type, hot, i, LANE_RAYS, &t);
    met = v_and(met, v_or(v_cmp_lt(t, best), v_and(v_cmp_eq(t, best), v_cmp_lt(mine, shape))));
    v_store(v_select(met, t, best), q->t + first);
    v_store(v_select(met, mine, shape), q->shape + first);
}

static inline void leaf_of_type(const struct query *q, enum solid type, const struct leaf *leaf,
                                const struct frustum *f) {
    COUNT(leaf_of_type, call);
    const struct hot *hot = &q->scene->tree.hot[type];
    int packets = (q->beams->count + LANES - 1) / LANES;
    for (int i = 0; i < leaf->count[type]; i += LANES) {
        int first = leaf->first[type] + i;
        unsigned which = v_mask_bits(v_mask_first(leaf->count[type] - i));
        if (f) {
            COUNT(leaf_of_type, group);
            vfloat lo[3], hi[3], begin;
            for (int k = 0; k < 3; k++) {
                vfloat centre = v_load(hot->field[F_CENTRE + k] + first);
                vfloat reach = v_load(hot->reach[k] + first);
                lo[k] = centre - reach;
                hi[k] = centre + reach;
            }
            which &= v_mask_bits(reached(f, lo, hi, &begin));
        }
        for (; which; which &= which - 1)
            for (int packet = 0; packet < packets; packet++)
                ask_solid(q, type, first + __builtin_ctz(which), packet);
    }
}

static void ask_leaf(const struct query *q, int number, struct frustum *f) {
    COUNT(ask_leaf, call);
    const struct leaf *leaf = &q->scene->tree.leaf[number];
    leaf_of_type(q, SOLID_SPHERE, leaf, f);
    leaf_of_type(q, SOLID_BOX, leaf, f);
    leaf_of_type(q, SOLID_CONE, leaf, f);
    if (f)
        f->far = most_along(q);
}

static void bvh_together(const struct query *q, struct frustum *f) {
    const struct tree *tree = &q->scene->tree;
    struct waiting stack[STACK];
    int count = 1;
    stack[0] = (struct waiting){0, 0};
    while (count > 0) {
        struct waiting next = stack[--count];
        if (!(next.begin <= f->far * f->steep))
            continue;
        if (next.child < 0) {
            ask_leaf(q, -1 - next.child, f);
            continue;
        }
        const float *box = tree->boxes + (size_t)next.child * 6 * LANES;
        vfloat lo[3], hi[3], begin;
        for (int k = 0; k < 3; k++) {
            lo[k] = v_load(box + k * LANES);
            hi[k] = v_load(box + (3 + k) * LANES);
        }
        unsigned which = v_mask_bits(reached(f, lo, hi, &begin));
        count = push(stack, count, which, begin, tree->child + next.child * LANES);
    }
}

static void kd_together(const struct query *q, struct frustum *f) {
    const struct tree *tree = &q->scene->tree;
    struct {
        int node;
        struct box cell;
    } stack[MOST_DEPTH];
    int count = 1;
    stack[0].node = 0;
    stack[0].cell = tree->bounds;
    while (count > 0) {
        int number = stack[--count].node;
        struct box cell = stack[count].cell;
        if (!cell_reached(f, &cell))
            continue;
        const struct kd_node *node = &tree->kd[number];
        if (node->axis == 3) {
            ask_leaf(q, node->below, f);
            continue;
        }
        // First the side that more of them come from.
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

static void go_together(const struct query *q, struct frustum *f) {
    COUNT(go_together, call);
    enum tree_kind kind = q->scene->tree.kind;
    if (kind == TREE_BVH)
        bvh_together(q, f);
    else if (kind == TREE_KD)
        kd_together(q, f);
    else
        ask_leaf(q, 0, NULL);
}

// By what a box may be off for what is rounded: of its own coordinates, of a ray's origin.
static float margin_of(const struct box *all) {
    float most = 0;
    for (int k = 0; k < 3; k++)
        most = larger(most, larger(fabsf(all->lo[k]), fabsf(all->hi[k])));
    return 1e-6f * most;
}

// Rays that diverge are tried again in parts of so many, and then of a packet each, before each goes alone.
enum { PARTED = 64 };

// Rays go together where their frustum is not expected to hold more solids than CROWD: a packet of them is tested against
// a solid in a 20th of the time that one ray alone takes. Of no more than FEW, packets are asked of each whatever way
// their rays go. (Of one slope range instead of a crowd: 4,096 spheres' shadow rays at half the speed of each alone.)
static const float CROWD = 256;
enum { FEW = 128 };

// Whether all rays are numbers and have a direction.
static bool proper(const struct beams *b) {
    COUNT(proper, call);
    vmask all = v_mask_first(LANES);
    for (int i = 0; i < b->count; i += LANES) {
        COUNT(proper, packet);
        struct vec o = load_vec(b->origin, i), d = load_vec(b->direction, i);
        vfloat square = vec_dot(d, d), size = v_abs(o.x) + v_abs(o.y) + v_abs(o.z);
        vmask good =
            v_and(v_cmp_gt(square, v_splat(0.0f)), v_cmp_lt(size + square, v_splat(INFINITY)));
        all = v_and(all, v_or(good, v_andnot(active_in(b, i / LANES), v_mask_first(LANES))));
    }
    return v_mask_bits(all) == v_mask_bits(v_mask_first(LANES));
}

// Of `count` rays from `first` on, as a query of their own.
static void ask_some(const struct query *whole, int first, int count) {
    COUNT(ask_some, call);
    const struct beams *b = whole->beams;
    const struct tree *tree = &whole->scene->tree;
    struct beams some = {.count = count};
    struct query q = *whole;
    for (int k = 0; k < 3; k++) {
        some.origin[k] = b->origin[k] + first;
        some.direction[k] = b->direction[k] + first;
    }
    some.near = b->near ? b->near + first : NULL;
    some.far = b->far ? b->far + first : NULL;
    some.own = b->own ? b->own + first : NULL;
    q.beams = &some;
    q.t += first;
    q.shape = q.any ? NULL : q.shape + first;
    struct frustum f;
    enum going rays = whole->scene->settings.rays;
    if (rays != GO_ALONE && frustum_of(&q, &f) &&
        (rays == GO_TOGETHER || crowd_in(&q, &f) <= CROWD)) {
        go_together(&q, &f);
        return;
    }
    if (rays == GO_AUTO && solids_in(tree) <= FEW && proper(&some)) {
        for (int leaf = 0; leaf < tree->leaves; leaf++)
            ask_leaf(&q, leaf, NULL);
        return;
    }
    int part = count > PARTED ? PARTED : count > LANES ? LANES : 0;
    if (part && rays != GO_ALONE) {
        for (int i = 0; i < count; i += part)
            ask_some(&q, i, count - i < part ? count - i : part);
        return;
    }
    float margin = margin_of(&tree->bounds);
    for (int i = 0; i < count; i++)
        go_alone(&q, i, margin);
}

static void ask(const struct query *q) {
    const struct prepared *scene = q->scene;
    const struct beams *b = q->beams;
    for (int k = 0; k < scene->plane_count; k++)
        for (int i = 0; i < b->count; i += LANES)
            ask_plane(q, scene->planes[k], i / LANES, active_in(b, i / LANES));
    if (scene->tree.leaves > 0)
        ask_some(q, 0, b->count);
}

void first_hits(const struct prepared *scene, const struct beams *beams, float *t, float *shape) {
    struct query q = {scene, beams, t, shape, false, scene->settings.newton};
    for (int i = 0; i < beams->count; i += LANES) {
        v_store(v_splat(INFINITY), t + i);
        v_store(v_splat(-1.0f), shape + i);
    }
    ask(&q);
}

void blocked(const struct prepared *scene, const struct beams *beams, float *t) {
    struct query q = {scene, beams, t, NULL, true, scene->settings.newton};
    for (int i = 0; i < beams->count; i += LANES)
        v_store(beams->far ? v_load(beams->far + i) : v_splat(INFINITY), t + i);
    ask(&q);
}
