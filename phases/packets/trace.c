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

static void ask_plane(const struct query *q, int index, int packet, mask active) {
    COUNT(ask_plane, call);
    const struct placed *s = &q->scene->placed[index];
    const struct beams *b = q->beams;
    int first = packet * LANES;
    real zero = set(0.0f), best = load(q->t + first);
    struct vec n = vec_set(s->normal), o = load_vec(b->origin, first);
    struct vec d = load_vec(b->direction, first);
    real height = vec_dot(o, n) - set(s->offset), slope = vec_dot(d, n);
    active = both(active, less(absolute(vec_dot(o, d)), set(INFINITY))); // numbers, and a direction
    active = both(active, greater(vec_dot(d, d), zero));
    if (b->own)
        active = but_not(equal(load(b->own + first), set((float)index)), active);
    if (q->any) { // solid below: at either end it is in the way
        COUNT(ask_plane, any);
        real near = b->near ? load(b->near + first) : zero;
        mask met = either(less(mul_add(slope, near, height), zero),
                          less(mul_add(slope, best, height), zero));
        unload(choose(both(met, active), set(-INFINITY), best), q->t + first);
        return;
    }
    COUNT(ask_plane, first);
    mask under = less(height, zero);
    real t = height / (zero - slope);
    t = choose(under, height, t);
    mask met = both(active, either(under, less(slope, zero)));
    real shape = load(q->shape + first), mine = set((float)index);
    met = both(met, either(less(t, best), both(equal(t, best), less(mine, shape))));
    unload(choose(met, t, best), q->t + first);
    unload(choose(met, mine, shape), q->shape + first);
}

// --- Together

static inline void ask_solid(const struct query *q, enum solid type, int i, int packet) {
    const struct beams *b = q->beams;
    mask active = active_in(b, packet);
    ACTIVE(count_of(active));
    COUNT(ask_solid, call);
    const struct hot *hot = &q->scene->tree.hot[type];
    int first = packet * LANES;
    struct vec o = load_vec(b->origin, first);
    real in, out, best = load(q->t + first), mine = set(hot->index[i]);
    struct vec d = load_vec(b->direction, first);
    mask met = meet(type, active, o, d, hot, i, LANE_RAYS, q->newton, &in, &out);
    if (!any(met))
        return;
    COUNT(ask_solid, met);
    if (b->own)
        met = but_not(equal(load(b->own + first), mine), met);
    if (q->any) {
        real near = b->near ? load(b->near + first) : set(0.0f);
        met = both(met, both(less(in, best), greater(out, near)));
        unload(choose(met, set(-INFINITY), best), q->t + first);
        return;
    }
    real t, shape = load(q->shape + first);
    met = entered(met, in, out, o, type, hot, i, LANE_RAYS, &t);
    met = both(met, either(less(t, best), both(equal(t, best), less(mine, shape))));
    unload(choose(met, t, best), q->t + first);
    unload(choose(met, mine, shape), q->shape + first);
}

static inline void leaf_of_type(const struct query *q, enum solid type, const struct leaf *leaf,
                                const struct frustum *f) {
    COUNT(leaf_of_type, call);
    const struct hot *hot = &q->scene->tree.hot[type];
    int packets = (q->beams->count + LANES - 1) / LANES;
    for (int i = 0; i < leaf->count[type]; i += LANES) {
        int first = leaf->first[type] + i;
        unsigned which = bits(first_lanes(leaf->count[type] - i));
        if (f) {
            COUNT(leaf_of_type, group);
            real lo[3], hi[3], begin;
            for (int k = 0; k < 3; k++) {
                real centre = load(hot->field[F_CENTRE + k] + first);
                real reach = load(hot->reach[k] + first);
                lo[k] = centre - reach;
                hi[k] = centre + reach;
            }
            which &= bits(reached(f, lo, hi, &begin));
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
        real lo[3], hi[3], begin;
        for (int k = 0; k < 3; k++) {
            lo[k] = load(box + k * LANES);
            hi[k] = load(box + (3 + k) * LANES);
        }
        unsigned which = bits(reached(f, lo, hi, &begin));
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
    mask all = first_lanes(LANES);
    for (int i = 0; i < b->count; i += LANES) {
        COUNT(proper, packet);
        struct vec o = load_vec(b->origin, i), d = load_vec(b->direction, i);
        real square = vec_dot(d, d), size = absolute(o.x) + absolute(o.y) + absolute(o.z);
        mask good = both(greater(square, set(0.0f)), less(size + square, set(INFINITY)));
        all = both(all, either(good, but_not(active_in(b, i / LANES), first_lanes(LANES))));
    }
    return bits(all) == bits(first_lanes(LANES));
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
        unload(set(INFINITY), t + i);
        unload(set(-1.0f), shape + i);
    }
    ask(&q);
}

void blocked(const struct prepared *scene, const struct beams *beams, float *t) {
    struct query q = {scene, beams, t, NULL, true, scene->settings.newton};
    for (int i = 0; i < beams->count; i += LANES)
        unload(beams->far ? load(beams->far + i) : set(INFINITY), t + i);
    ask(&q);
}
