// Cone queries on the BVH: does any sphere come into the cone about a shadow ray? A node is tested against
// the cone about all rays at once; only the leaves that it meets are tested ray by ray.
#include "bvh/bvh_lists.h"
#include "bvh/bvh_traversal.h"
#include "types/numerics.h"

// Tests which cones meet a sphere beyond t, and sets b and the discriminant (a quarter) of a·t² − 2·b·t + c =
// 0. Its rounding is 8·2⁻²⁴·|v|², its margin 2e-6·a·|v|². For a < 1/4 (q > 0.87) a sphere that the cone only
// grazes may be missed; its term would be next to 1.
static inline vmask cone_meets_sphere(const struct ray_cone *cone, struct vec centre, vfloat radius,
                                      vfloat *b, vfloat *discriminant) {
    vfloat zero = v_splat(0.0f);
    struct vec v = vec_sub(centre, cone->point);
    vfloat square = vec_dot(v, v);
    vfloat c = v_msub(square, v_splat(1 - 2e-6f), radius * radius * v_splat(1 + 1e-5f));
    *b = v_madd(cone->q, radius, vec_dot(v, cone->to_light));
    *discriminant = v_msub(*b, *b, cone->a * c);
    vmask comes = v_or(v_cmp_lt(c, zero), v_cmp_gt(*b, zero));
    // The cone leaves the sphere at (b + √discriminant)/a. That is not before t if √discriminant ≥ over; a
    // negative discriminant fails.
    vfloat over = v_max(cone->ahead - *b, zero);
    return v_and(comes, v_cmp_ge(*discriminant, over * over));
}

// A bundle of rays that start within `radius` of `centre`: largest difference of directions, widest cone and
// least t.
struct query_bundle {
    struct vec centre, to_light;
    float radius, spread, q, least_t;
};

// Makes a bundle of the first open ray and all open rays within `near` of it. They become `now`.
static struct query_bundle query_bundle_of(struct packet_cones *cones, int count, float near) {
    int chosen = 0;
    while (!v_any(cones[chosen].open))
        chosen++;
    const struct ray_cone *first = &cones[chosen].rays;
    int one = __builtin_ctz(v_mask_bits(cones[chosen].open));
    struct vec centre = vec_of_lane(&first->point, one), to = vec_of_lane(&first->to_light, one);
    vfloat reach = v_splat(near * near), zero = v_splat(0.0f), away = zero, turned = zero, q = zero,
           from = v_splat(INFINITY);
    for (int i = 0; i < count; i++) {
        struct packet_cones *c = &cones[i];
        c->now = v_mask_none(); // of the previous bundle
        if (!v_any(c->open))
            continue;
        struct vec v = vec_sub(c->rays.point, centre);
        struct vec l = vec_sub(c->rays.to_light, to);
        vfloat square = vec_dot(v, v);
        vmask itself = i == chosen ? v_mask_of_bits(1u << one) : v_mask_none();
        c->now = v_or(itself, v_and(c->open, v_cmp_lt(square, reach)));
        c->open = v_andnot(c->now, c->open);
        away = v_max(away, v_select_or_zero(c->now, square));
        turned = v_max(turned, v_select_or_zero(c->now, vec_dot(l, l)));
        q = v_max(q, v_select_or_zero(c->now, c->rays.q));
        from = v_min(from, v_select(c->now, c->t, v_splat(INFINITY)));
    }
    return (struct query_bundle){centre,
                                 to,
                                 sqrtf(most_lane(away)) * (1 + 1e-4f),
                                 sqrtf(most_lane(turned)) * 1.01f + 1e-4f,
                                 most_lane(q),
                                 v_reduce_min(from)};
}

// Tests a leaf against the rays `now`, and sets `until` of those that it blocks. Returns whether it blocks
// any; *left: whether any ray `now` remains.
static bool cones_meet_leaf(const struct bvh *tree, int leaf, struct packet_cones *cones, int count,
                            bool *left) {
    const struct sphere_array *s = &tree->level[0];
    bool met = false;
    *left = false;
    for (int i = 0; i < count; i++) {
        struct packet_cones *c = &cones[i];
        if (!v_any(c->now))
            continue;
        vfloat b, discriminant;
        vmask meets = v_and(v_andnot(is_shape(c->excluded, tree->shape[leaf]), c->now),
                            cone_meets_sphere(&c->rays,
                                              (struct vec){v_splat(s->x[leaf]), v_splat(s->y[leaf]),
                                                           v_splat(s->z[leaf])},
                                              v_splat(s->radius[leaf]), &b, &discriminant));
        if (v_any(meets)) {
            vfloat leaves = (b + v_sqrt(v_max(discriminant, v_splat(0.0f)))) / c->rays.a;
            c->until = v_select(meets, leaves, c->until);
            c->now = v_andnot(meets, c->now);
            met = true;
        }
        *left |= v_any(c->now);
    }
    return met;
}

// Traverses the BVH with the cone about all rays of a bundle, and tests the leaves that it meets ray by ray.
// Ends when each ray has a blocker. The furthest child is visited first: its blocker is passed last.
static void cone_query_bundle(const struct bvh *tree, const struct ray_cone *about, vfloat wider,
                              struct packet_cones *cones, int packets, int *leaf) {
    int waiting[STACK_ROOM]; // not zeroed
    waiting[0] = pack_node(tree->levels - 1, 0);
    for (int count = 1; count > 0;) {
        int level = node_level(waiting[--count]), node = node_index(waiting[count]);
        const struct sphere_array *s = &tree->level[level];
        int end = int_min(s->count, (node + 1) * BVH_WIDTH);
        for (int first = node * BVH_WIDTH; first < end; first += LANES) {
            struct vec centre = {v_load(s->x + first), v_load(s->y + first), v_load(s->z + first)};
            vfloat b, discriminant;
            vmask meets = v_and(cone_meets_sphere(about, centre, v_load(s->radius + first) + wider,
                                                  &b, &discriminant),
                                v_mask_first(end - first));
            unsigned which = v_mask_bits(meets);
            if (!which)
                continue;
            if (level > 0) {
                vfloat order = v_select(meets, v_splat(0.0f) - b, v_splat(INFINITY));
                unsigned last = v_mask_bits(v_cmp_ge(v_splat(v_reduce_min(order)), order)) & which;
                last &= 0u - last;
                count += push_nodes(v_andnot(v_mask_of_bits(last), meets), level, first,
                                    waiting + count);
                waiting[count++] = pack_node(level - 1, first + __builtin_ctz(last));
                continue;
            }
            for (; which; which &= which - 1) {
                int entry = first + __builtin_ctz(which);
                bool left;
                *leaf = cones_meet_leaf(tree, entry, cones, packets, &left) ? entry : *leaf;
                if (!left)
                    return;
            }
        }
    }
}

// Finds a blocker for each open ray; `until` is unchanged where there is none. Starts with the leaf that
// blocked the last query, then takes bundles of neighbouring rays.
void bvh_cone_query(const struct bvh *tree, struct packet_cones *cones, int count, int *leaf) {
    bool left = false;
    for (int i = 0; i < count; i++) {
        cones[i].now = cones[i].open;
        left |= v_any(cones[i].open);
    }
    if (!left)
        return;
    if (*leaf >= 0) {
        cones_meet_leaf(tree, *leaf, cones, count, &left);
        for (int i = 0; i < count; i++)
            cones[i].open = cones[i].now;
    }
    while (left) {
        struct query_bundle bundle = query_bundle_of(cones, count, tree->spacing);
        float q = bundle.q + bundle.spread;
        if (!(q < 0.995f)) { // too wide for a test: the bundle shrinks to one ray
            for (int i = 0; i < count; i++)
                cones[i].open = v_or(cones[i].open, cones[i].now);
            bundle = query_bundle_of(cones, count, 0.0f);
            q = bundle.q + bundle.spread;
        }
        float a = 1 - q * q;
        struct ray_cone about = {bundle.centre, bundle.to_light, v_splat(q), v_splat(a),
                                 v_splat(a * bundle.least_t)};
        cone_query_bundle(tree, &about, v_splat(bundle.radius), cones, count, leaf);
        left = false;
        for (int i = 0; i < count; i++)
            left |= v_any(cones[i].open);
    }
}
