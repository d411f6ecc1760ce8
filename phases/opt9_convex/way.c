// Whether anything comes into cones about rays: the spheres of a node in the lanes for all rays, then the rays.
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
    mask meets = either(less(need, zero), both(greater(*lean, zero), not_less(*rest, zero)));
    real over = c->ahead - *lean; // it is left at (lean + √rest)/narrow
    return both(meets, either(less(over, zero), not_less(*rest, over * over)));
}

static float most_of_those(mask of, real x) {
    return -least_lane(choose(of, set(0.0f) - x, set(INFINITY)));
}

// Rays from near the first one's place: how far they are from it at most, and how much they turn from its direction.
struct sheaf {
    mask rays;
    struct vec centre, to_light;
    float radius, spread;
};

static struct sheaf sheaf_of(const struct cone_of_one *rays, mask of, float near) {
    COUNT(sheaf_of, call);
    COUNT(sheaf_of, scalar);
    int one = __builtin_ctz(bits(of));
    struct vec centre = vec_of_lane(&rays->point, one), to = vec_of_lane(&rays->to_light, one);
    struct vec v = {rays->point.x - centre.x, rays->point.y - centre.y, rays->point.z - centre.z};
    struct vec l = {rays->to_light.x - to.x, rays->to_light.y - to.y, rays->to_light.z - to.z};
    real away = vec_dot(v, v);
    mask those = either(lanes_of(1u << one), both(of, less(away, set(near * near))));
    return (struct sheaf){those, centre, to, sqrtf(most_of_those(those, away)) * (1 + 1e-4f),
                          sqrtf(most_of_those(those, vec_dot(l, l))) * 1.01f + 1e-4f};
}

// Those that do not meet a leaf; for the others, where they leave it. Rays do not meet the shape that they are from, `own`.
static inline mask passes(const struct tree *tree, int leaf, const struct cone_of_one *rays,
                          real own, mask open, real *until) {
    COUNT(passes, call);
    const struct spheres *s = &tree->level[0];
    real lean, rest;
    mask meets =
        both(but_not(same_shape(own, tree->shape[leaf]), open),
             in_its_way(rays, (struct vec){set(s->x[leaf]), set(s->y[leaf]), set(s->z[leaf])},
                        set(s->radius[leaf]), &lean, &rest));
    if (any(meets)) {
        ACTIVE(count_of(meets));
        COUNT(passes, met);
        real leaves = (lean + root(most_of(rest, set(0.0f)))) / rays->narrow;
        *until = choose(meets, leaves, *until);
    }
    return but_not(meets, open);
}

// The spheres of a node in the lanes, asked for a cone about all rays, and what that meets with the rays in the lanes. Ends
// when each ray has something in its way: not all that is. What is furthest is asked first: what is in the way there is so for
// long.
static void look_behind(const struct tree *tree, const struct cone_of_one *about, real wider,
                        const struct cone_of_one *rays, real own, mask open, real *until,
                        int *leaf) {
    COUNT(look_behind, call);
    int waiting[TREE_LEVELS * TREE_WIDTH]; // level + TREE_LEVELS·node; not zeroed
    waiting[0] = tree->levels - 1;
    for (int count = 1; count > 0;) {
        int level = waiting[--count] % TREE_LEVELS, node = waiting[count] / TREE_LEVELS;
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
                for (which &= ~last; which; which &= which - 1)
                    waiting[count++] = level - 1 + TREE_LEVELS * (first + __builtin_ctz(which));
                waiting[count++] = level - 1 + TREE_LEVELS * (first + __builtin_ctz(last));
                continue;
            }
            for (; which; which &= which - 1) {
                int entry = first + __builtin_ctz(which);
                ACTIVE(count_of(open));
                mask left = passes(tree, entry, rays, own, open, until);
                *leaf = bits(left) == bits(open) ? *leaf : entry;
                open = left;
                if (!any(open))
                    return;
            }
        }
    }
}

// Of each lane asked, for its own cone: where something that it meets is left, −1 where nothing is met. Asked for all at
// once that are near to each other.
static real ways_end(const struct tree *tree, const struct cone_of_one *rays, real t, real own,
                     mask asked, int *leaf) {
    COUNT(ways_end, call);
    real until = set(-1.0f);
    mask open = asked;
    if (*leaf >= 0)
        open = passes(tree, *leaf, rays, own, open, &until);
    while (any(open)) {
        ACTIVE(count_of(open));
        struct sheaf sheaf = sheaf_of(rays, open, tree->spacing);
        float q = most_of_those(sheaf.rays, rays->q) + sheaf.spread;
        if (!(q < 0.995f)) {
            sheaf = sheaf_of(rays, open, 0.0f);
            q = most_of_those(sheaf.rays, rays->q) + sheaf.spread;
        }
        COUNT(ways_end, asked);
        COUNT(ways_end, scalar);
        float narrow = 1 - q * q, from = least_lane(choose(sheaf.rays, t, set(INFINITY)));
        struct cone_of_one about = {sheaf.centre, sheaf.to_light, set(q), set(narrow),
                                    set(narrow * from)};
        look_behind(tree, &about, set(sheaf.radius), rays, own, sheaf.rays, &until, leaf);
        open = but_not(sheaf.rays, open);
    }
    return until;
}

mask crowd_behind(const struct rays *r, real t, real q, mask asked, real *until,
                  const struct convex *work) {
    ACTIVE(count_of(asked));
    COUNT(crowd_behind, call);
    const struct prepared *scene = work->scene;
    q = least_of(q, set(0.99f));
    mask blocked = no_lane();
    for (int k = 0; k < scene->plane_count; k++) {
        const struct placed *s = &scene->placed[scene->planes[k]];
        COUNT(crowd_behind, plane);
        real slope = vec_dot(vec_set(s->normal), r->to_light);
        blocked = either(blocked, less(slope, q));
    }
    asked = but_not(blocked, asked);
    real narrow = neg_mul_add(q, q, set(1.0f));
    struct cone_of_one rays = {r->point, r->to_light, q, narrow, narrow * t};
    real ends = ways_end(&scene->tree, &rays, t, set(-1.0f), asked, &work->desk->far);
    *until = choose(blocked, set(INFINITY), ends);
    return both(asked, less(ends, set(0.0f)));
}

mask crowd_clears(struct vec point, struct vec local, struct vec to_light, real facing, real shape,
                  mask active, const struct convex *work) {
    ACTIVE(count_of(active));
    COUNT(crowd_clears, call);
    const struct prepared *scene = work->scene;
    float q = scene->lit_slope;
    mask clear = active;
    for (int k = 0; k < scene->plane_count; k++) {
        int i = scene->planes[k];
        COUNT(crowd_clears, plane);
        mask here = plane_clears(height_over(&scene->placed[i], point),
                                 vec_dot(vec_set(scene->placed[i].normal), to_light), q, scene);
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
            clear = but_not(but_not(bulges(&scene->placed[i], local, facing, scene), same), clear);
    }
    if (!any(clear) || q >= 0.99f)
        return no_lane();
    COUNT(crowd_clears, asked);
    real zero = set(0.0f);
    struct cone_of_one cones = {point, to_light, set(q), set(1 - q * q), zero};
    real ends = ways_end(&scene->tree, &cones, zero, shape, clear, &work->desk->leaf);
    return both(clear, less(ends, zero));
}
