// Whether anything comes into a cone about a ray, asked ray by ray: the spheres of a node in the lanes.
#include "seek.h"

// A ray of which it is asked whether anything ahead of t comes nearer than q·t, the spheres in the lanes.
struct cone_of_one {
    struct vec point, to_light;
    real q, narrow, ahead; // narrow: 1 − q²; ahead: narrow·t
};

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

// Which of the entries from `first` on the cone meets.
static inline mask met_in_node(const struct tree *tree, const struct cone_of_one *cone, int level,
                               int first, int end, real *lean, real *rest) {
    ACTIVE(lesser(LANES, end - first));
    COUNT(met_in_node, call);
    const struct spheres *s = &tree->level[level];
    struct vec centre = {load(s->x + first), load(s->y + first), load(s->z + first)};
    return both(in_its_way(cone, centre, load(s->radius + first), lean, rest),
                first_lanes(end - first));
}

static float last_left(mask meets, real lean, real rest, const struct cone_of_one *cone) {
    COUNT(last_left, call);
    real leaves = (lean + root(most_of(rest, set(0.0f)))) / cone->narrow;
    return -least_lane(choose(meets, set(0.0f) - leaves, set(INFINITY)));
}

// Where the last of some that the cone meets is left: those of one row of lanes, the furthest it happens upon. −1: it
// meets nothing. *row: what the ray before it met, which is likely to be in this one's way too.
static float way_ends(const struct tree *tree, const struct cone_of_one *cone, int *row) {
    COUNT(way_ends, call);
    real lean, rest;
    int leaves = tree->level[0].count;
    if (*row >= 0) {
        COUNT(way_ends, row);
        mask meets = met_in_node(tree, cone, 0, *row, leaves, &lean, &rest);
        if (any(meets))
            return last_left(meets, lean, rest, cone);
    }
    int waiting[TREE_LEVELS * TREE_WIDTH]; // level + TREE_LEVELS·node; not zeroed
    waiting[0] = tree->levels - 1;
    for (int count = 1; count > 0;) {
        int level = waiting[--count] % TREE_LEVELS, node = waiting[count] / TREE_LEVELS;
        int end = lesser(tree->level[level].count, (node + 1) * TREE_WIDTH);
        for (int first = node * TREE_WIDTH; first < end; first += LANES) {
            mask meets = met_in_node(tree, cone, level, first, end, &lean, &rest);
            unsigned which = bits(meets);
            if (!which)
                continue;
            if (level == 0) {
                *row = first;
                return last_left(meets, lean, rest, cone);
            }
            // The furthest is looked into first: what is in the way there is so for long.
            COUNT(way_ends, nodes);
            real order = choose(meets, set(0.0f) - lean, set(INFINITY));
            unsigned last = bits(not_less(set(least_lane(order)), order)) & which;
            last &= 0u - last;
            for (which &= ~last; which; which &= which - 1)
                waiting[count++] = level - 1 + TREE_LEVELS * (first + __builtin_ctz(which));
            waiting[count++] = level - 1 + TREE_LEVELS * (first + __builtin_ctz(last));
        }
    }
    return -1;
}

// Of each lane asked, for its own cone; −1 where nothing is met.
static real ways_end(const struct tree *tree, struct vec point, struct vec to_light, real t, real q,
                     mask asked, int *row) {
    COUNT(ways_end, call);
    float lanes[8][LANES], until[LANES] = {0};
    const real of[8] = {point.x, point.y, point.z, to_light.x, to_light.y, to_light.z, t, q};
    for (int i = 0; i < 8; i++)
        unload(of[i], lanes[i]);
    for (unsigned rest = bits(asked); rest; rest &= rest - 1) {
        COUNT(ways_end, ray);
        int i = __builtin_ctz(rest);
        float narrow = 1 - lanes[7][i] * lanes[7][i];
        struct cone_of_one cone = {{set(lanes[0][i]), set(lanes[1][i]), set(lanes[2][i])},
                                   {set(lanes[3][i]), set(lanes[4][i]), set(lanes[5][i])},
                                   set(lanes[7][i]),
                                   set(narrow),
                                   set(narrow * lanes[6][i])};
        until[i] = way_ends(tree, &cone, row);
    }
    return load(until);
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
    real ends = ways_end(&scene->tree, r->point, r->to_light, t, q, asked, &work->desk->row);
    *until = choose(blocked, set(INFINITY), ends);
    return both(asked, less(ends, set(0.0f)));
}

static float most_lane(mask of, real x) {
    return -least_lane(choose(of, set(0.0f) - x, set(INFINITY)));
}

// Of some rays, from the first one's place and in its direction.
static struct shaft shaft_about(const struct cone_of_one *rays, float q, mask of) {
    COUNT(shaft_about, call);
    COUNT(shaft_about, scalar);
    mask one = lanes_of(bits(of) & (0u - bits(of)));
    const real from[6] = {rays->point.x,    rays->point.y,    rays->point.z,
                          rays->to_light.x, rays->to_light.y, rays->to_light.z};
    real first[6];
    for (int k = 0; k < 6; k++)
        first[k] = set(most_lane(one, from[k]));
    struct vec centre = {first[0], first[1], first[2]}, to_light = {first[3], first[4], first[5]};
    struct vec v = {from[0] - first[0], from[1] - first[1], from[2] - first[2]};
    struct vec l = {from[3] - first[3], from[4] - first[4], from[5] - first[5]};
    float radius = sqrtf(most_lane(of, vec_dot(v, v))) * (1 + 1e-4f),
          spread = sqrtf(most_lane(of, vec_dot(l, l))) * 1.01f + 1e-4f;
    q += spread;
    real reach = absolute(centre.x) + absolute(centre.y) + absolute(centre.z);
    return shaft_of(centre, to_light, radius, reach, q);
}

static inline mask in_way_of(const struct tree *tree, int leaf, const struct cone_of_one *rays,
                             real own) {
    COUNT(in_way_of, call);
    const struct spheres *s = &tree->level[0];
    real lean, rest;
    mask meets = in_its_way(rays, (struct vec){set(s->x[leaf]), set(s->y[leaf]), set(s->z[leaf])},
                            set(s->radius[leaf]), &lean, &rest);
    return but_not(same_shape(own, tree->shape[leaf]), meets);
}

// Which of the rays' cones of slope q meet a shape that the ray is not from: the rays in the lanes, for those shapes that are
// in a shaft about all of them. What was in the way of those before is asked first.
static mask blocked_by_others(const struct tree *tree, const struct cone_of_one *rays, float q,
                              real own, mask asked, struct desk *desk) {
    COUNT(blocked_by_others, call);
    mask open = asked;
    if (desk->leaf >= 0)
        open = but_not(in_way_of(tree, desk->leaf, rays, own), open);
    if (!any(open))
        return asked;
    struct shaft shaft = shaft_about(rays, q, open);
    int waiting[TREE_LEVELS * TREE_WIDTH]; // level + TREE_LEVELS·node; not zeroed
    waiting[0] = tree->levels - 1;
    for (int count = 1; count > 0;) {
        int level = waiting[--count] % TREE_LEVELS, node = waiting[count] / TREE_LEVELS;
        const struct spheres *s = &tree->level[level];
        int end = lesser(s->count, (node + 1) * TREE_WIDTH);
        unsigned which = 0; // of all rows: no branch foresees whether one has any
        for (int first = node * TREE_WIDTH; first < end; first += LANES) {
            ACTIVE(lesser(LANES, end - first));
            COUNT(blocked_by_others, spheres);
            struct vec centre = {load(s->x + first), load(s->y + first), load(s->z + first)};
            mask matter =
                both(in_shaft(centre, load(s->radius + first), &shaft), first_lanes(end - first));
            which |= bits(matter) << (first - node * TREE_WIDTH);
        }
        for (; which; which &= which - 1) {
            int entry = node * TREE_WIDTH + __builtin_ctz(which);
            if (level > 0) {
                waiting[count++] = level - 1 + TREE_LEVELS * entry;
                continue;
            }
            ACTIVE(count_of(open));
            mask blocked = both(open, in_way_of(tree, entry, rays, own));
            // Without a branch: none foresees it.
            desk->leaf ^= (desk->leaf ^ entry) & -(int)any(blocked);
            open = but_not(blocked, open);
            if (!any(open))
                return asked;
        }
    }
    return but_not(open, asked);
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
    struct cone_of_one cone = {point, to_light, set(q), set(1 - q * q), set(0.0f)};
    return but_not(blocked_by_others(&scene->tree, &cone, q, shape, clear, work->desk), clear);
}
