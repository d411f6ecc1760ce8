// Whether anything comes into cones about rays: the spheres of a node in the lanes for all rays, then the rays.
#include "beam.h"
#include "seek.h"

// A ray of which it is asked whether anything ahead of t comes nearer than q·t, the spheres in the lanes.
struct cone_of_one {
    struct vec point, to_light;
    real q, narrow, ahead; // narrow: 1 − q²; ahead: narrow·t
};

// The quadratic of a cone with a sphere: narrow·t² − 2·lean·t + need = 0, `rest` a quarter of its discriminant. That is
// rounded by 8·2⁻²⁴·|v|², and its margin 2e-6·narrow·|v|²: where narrow is less than a quarter (q above 0.87) a sphere that the
// cone no more than grazes may be told to be beside it. The term that it would have brought is next to 1.
static inline mask in_its_way(const struct cone_of_one *c, struct vec centre, real radius,
                              real *lean, real *rest) {
    COUNT(in_its_way, call);
    real zero = set(0.0f);
    struct vec v = {centre.x - c->point.x, centre.y - c->point.y, centre.z - c->point.z};
    real square = vec_dot(v, v);
    real need = mul_sub(square, set(1 - 2e-6f), radius * radius * set(1 + 1e-5f));
    *lean = mul_add(c->q, radius, vec_dot(v, c->to_light));
    *rest = mul_sub(*lean, *lean, c->narrow * need);
    mask comes = either(less(need, zero), greater(*lean, zero));
    // It is left at (lean + √rest)/narrow, and not before `ahead` if √rest ≥ over; no rest below 0 is as much as that square.
    real over = most_of(c->ahead - *lean, zero);
    return both(comes, not_less(*rest, over * over));
}

// A packet's rays of which it is asked.
struct cones {
    struct cone_of_one rays;
    real t, own;    // own: a shape that they do not meet
    real until;     // where what they meet ends, if anything
    mask open, now; // not asked yet; in the sheaf that is asked, with nothing met so far
};

// Rays from near the first one's place: how far they are from it at most, how much they turn from its direction, the widest
// cone and the least t.
struct sheaf {
    struct vec centre, to_light;
    float radius, spread, q, from;
};

// Takes the first ray that is open and those open near to it: they are `now`, and open no longer.
static struct sheaf sheaf_of(struct cones *cones, int count, float near) {
    int chosen = 0;
    while (!any(cones[chosen].open))
        chosen++;
    ACTIVE(count_of(cones[chosen].open));
    COUNT(sheaf_of, call);
    COUNT(sheaf_of, scalar);
    const struct cone_of_one *first = &cones[chosen].rays;
    int one = __builtin_ctz(bits(cones[chosen].open));
    struct vec centre = vec_of_lane(&first->point, one), to = vec_of_lane(&first->to_light, one);
    real reach = set(near * near), zero = set(0.0f), away = zero, turned = zero, q = zero,
         from = set(INFINITY);
    for (int i = 0; i < count; i++) {
        struct cones *c = &cones[i];
        c->now = no_lane(); // of the sheaf before
        if (!any(c->open))
            continue;
        ACTIVE(count_of(c->open));
        COUNT(sheaf_of, packet);
        struct vec v = {c->rays.point.x - centre.x, c->rays.point.y - centre.y,
                        c->rays.point.z - centre.z};
        struct vec l = {c->rays.to_light.x - to.x, c->rays.to_light.y - to.y,
                        c->rays.to_light.z - to.z};
        real square = vec_dot(v, v);
        mask itself = i == chosen ? lanes_of(1u << one) : no_lane();
        c->now = either(itself, both(c->open, less(square, reach)));
        c->open = but_not(c->now, c->open);
        away = most_of(away, keep(c->now, square));
        turned = most_of(turned, keep(c->now, vec_dot(l, l)));
        q = most_of(q, keep(c->now, c->rays.q));
        from = least_of(from, choose(c->now, c->t, set(INFINITY)));
    }
    return (struct sheaf){centre,
                          to,
                          sqrtf(most_lane(away)) * (1 + 1e-4f),
                          sqrtf(most_lane(turned)) * 1.01f + 1e-4f,
                          most_lane(q),
                          least_lane(from)};
}

// Which of the rays `now` meet a leaf, and where they leave it. Whether any does, and whether any does not.
static bool leaf_in_way(const struct tree *tree, int leaf, struct cones *cones, int count,
                        bool *left) {
    COUNT(leaf_in_way, call);
    const struct spheres *s = &tree->level[0];
    bool met = false;
    *left = false;
    for (int i = 0; i < count; i++) {
        struct cones *c = &cones[i];
        if (!any(c->now))
            continue;
        ACTIVE(count_of(c->now));
        COUNT(leaf_in_way, packet);
        real lean, rest;
        mask meets = both(
            but_not(same_shape(c->own, tree->shape[leaf]), c->now),
            in_its_way(&c->rays, (struct vec){set(s->x[leaf]), set(s->y[leaf]), set(s->z[leaf])},
                       set(s->radius[leaf]), &lean, &rest));
        if (any(meets)) {
            ACTIVE(count_of(meets));
            COUNT(leaf_in_way, met);
            real leaves = (lean + root(most_of(rest, set(0.0f)))) / c->rays.narrow;
            c->until = choose(meets, leaves, c->until);
            c->now = but_not(meets, c->now);
            met = true;
        }
        *left |= any(c->now);
    }
    return met;
}

// The spheres of a node in the lanes, asked for a cone about all rays, and what that meets with the rays in the lanes. Ends
// when each ray has something in its way: not all that is. What is furthest is asked first: what is in the way there is so for
// long.
static void look_behind(const struct tree *tree, const struct cone_of_one *about, real wider,
                        struct cones *cones, int packets, int *leaf) {
    COUNT(look_behind, call);
    int waiting[NODES_WAIT]; // not zeroed
    waiting[0] = waiting_node(tree->levels - 1, 0);
    for (int count = 1; count > 0;) {
        int level = level_of(waiting[--count]), node = node_of(waiting[count]);
        const struct spheres *s = &tree->level[level];
        int end = lesser(s->count, (node + 1) * TREE_WIDTH);
        for (int first = node * TREE_WIDTH; first < end; first += LANES) {
            ACTIVE(lesser(LANES, end - first));
            COUNT(look_behind, spheres);
            struct vec centre = {load(s->x + first), load(s->y + first), load(s->z + first)};
            real lean, rest;
            mask meets =
                both(in_its_way(about, centre, load(s->radius + first) + wider, &lean, &rest),
                     first_lanes(end - first));
            unsigned which = bits(meets);
            if (!which)
                continue;
            if (level > 0) {
                COUNT(look_behind, nodes);
                real order = choose(meets, set(0.0f) - lean, set(INFINITY));
                unsigned last = bits(not_less(set(least_lane(order)), order)) & which;
                last &= 0u - last;
                count += let_wait(but_not(lanes_of(last), meets), level, first, waiting + count);
                waiting[count++] = waiting_node(level - 1, first + __builtin_ctz(last));
                continue;
            }
            for (; which; which &= which - 1) {
                int entry = first + __builtin_ctz(which);
                bool left;
                *leaf = leaf_in_way(tree, entry, cones, packets, &left) ? entry : *leaf;
                if (!left)
                    return;
            }
        }
    }
}

// Of each ray that is open, for its own cone: where something that it meets is left; `until` stays where nothing is met. Asked
// for all at once that are near to each other.
static void ways_end(const struct tree *tree, struct cones *cones, int count, int *leaf) {
    COUNT(ways_end, call);
    bool left = false;
    for (int i = 0; i < count; i++) {
        cones[i].now = cones[i].open;
        left |= any(cones[i].open);
    }
    if (!left)
        return;
    if (*leaf >= 0) {
        leaf_in_way(tree, *leaf, cones, count, &left);
        for (int i = 0; i < count; i++)
            cones[i].open = cones[i].now;
    }
    while (left) {
        struct sheaf sheaf = sheaf_of(cones, count, tree->spacing);
        float q = sheaf.q + sheaf.spread;
        if (!(q < 0.995f)) { // too wide to tell anything: all but the first are put back
            COUNT(ways_end, again);
            for (int i = 0; i < count; i++)
                cones[i].open = either(cones[i].open, cones[i].now);
            sheaf = sheaf_of(cones, count, 0.0f);
            q = sheaf.q + sheaf.spread;
        }
        COUNT(ways_end, asked);
        float narrow = 1 - q * q;
        struct cone_of_one about = {sheaf.centre, sheaf.to_light, set(q), set(narrow),
                                    set(narrow * sheaf.from)};
        look_behind(tree, &about, set(sheaf.radius), cones, count, leaf);
        left = false;
        for (int i = 0; i < count; i++)
            left |= any(cones[i].open);
    }
}

void crowd_behind(struct asking *asking, int count, const struct convex *work) {
    COUNT(crowd_behind, call);
    const struct prepared *scene = work->scene;
    struct cones cones[BEAM];
    for (int i = 0; i < count; i++) {
        struct asking *a = &asking[i];
        ACTIVE(count_of(a->asked));
        COUNT(crowd_behind, packet);
        real q = least_of(a->q, set(0.99f));
        mask blocked = no_lane();
        for (int k = 0; k < scene->plane_count; k++) {
            const struct placed *s = &scene->placed[scene->planes[k]];
            COUNT(crowd_behind, plane);
            real slope = vec_dot(vec_set(s->normal), a->rays->to_light);
            blocked = either(blocked, less(slope, q));
        }
        real narrow = neg_mul_add(q, q, set(1.0f));
        cones[i] = (struct cones){{a->rays->point, a->rays->to_light, q, narrow, narrow * a->t},
                                  a->t,
                                  a->own,
                                  choose(blocked, set(INFINITY), set(-1.0f)),
                                  but_not(blocked, a->asked),
                                  no_lane()};
    }
    ways_end(&scene->tree, cones, count, &work->desk->far);
    for (int i = 0; i < count; i++)
        asking[i].until = cones[i].until;
}

mask crowd_clears(struct vec point, struct vec local, struct vec to_light, real facing, real shape,
                  mask active, const struct convex *work) {
    ACTIVE(count_of(active));
    COUNT(crowd_clears, call);
    const struct prepared *scene = work->scene;
    float q = scene->known.lit_slope;
    mask clear = active;
    for (int k = 0; k < scene->plane_count; k++) {
        int i = scene->planes[k];
        COUNT(crowd_clears, plane);
        mask here =
            plane_clears(height_over(&scene->placed[i], point),
                         vec_dot(vec_set(scene->placed[i].normal), to_light), q, &scene->known);
        clear = both(clear, either(same_shape(shape, i), here));
    }
    float id[LANES];
    unload(shape, id);
    for (unsigned rest = bits(clear); rest;) { // once for each shape that they are on
        int i = (int)id[__builtin_ctz(rest)];
        mask same = both(lanes_of(rest), same_shape(shape, i));
        COUNT(crowd_clears, shape);
        rest &= ~bits(same);
        if (scene->placed[i].way != LINEAR)
            clear = but_not(but_not(bulges(&scene->placed[i], local, facing, &scene->known), same),
                            clear);
    }
    if (!any(clear) || q >= 0.99f)
        return no_lane();
    COUNT(crowd_clears, asked);
    real zero = set(0.0f);
    struct cones cones = {
        {point, to_light, set(q), set(1 - q * q), zero}, zero, shape, set(-1.0f), clear, no_lane()};
    ways_end(&scene->tree, &cones, 1, &work->desk->leaf);
    return both(clear, less(cones.until, zero));
}
