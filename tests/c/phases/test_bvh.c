// flags: -iquote phases/opt9_convex -iquote phases/opt6_wide
// opt9_convex's BVH (core/bvh.c): every shape is a leaf once, every node's sphere holds its children's, and the root's
// sphere holds every leaf. Checked in double.
#include "tests/c/testing.h"

#include <math.h>
#include <stdlib.h>

#include "core/bvh.c"

enum { MOST = BVH_WIDTH * BVH_WIDTH * BVH_WIDTH };

static float random_from(float least, float most) { // after xorshift32 (G. Marsaglia, 2003)
    static uint32_t seed = 1;
    seed ^= seed << 13;
    seed ^= seed >> 17;
    seed ^= seed << 5;
    return least + (most - least) * ((float)seed * 0x1p-32f);
}

static double reaches(const float from[3], const struct sphere_array *s, int i) {
    double x = s->x[i] - (double)from[0], y = s->y[i] - (double)from[1],
           z = s->z[i] - (double)from[2];
    return sqrt(x * x + y * y + z * z) + s->radius[i];
}

static void check(int count, float spread, float size) {
    static struct bvh_leaf leaves[MOST], given[MOST];
    static bool seen[MOST];
    for (int i = 0; i < count; i++) {
        leaves[i] = (struct bvh_leaf){.radius = random_from(0, size), .shape = i};
        for (int k = 0; k < 3; k++)
            leaves[i].centre[k] = 30 + random_from(-spread, spread);
        given[i] = leaves[i];
        seen[i] = false;
    }
    struct bvh tree = {0};
    assert_true(bvh_reserve(&tree, count));
    bvh_build(&tree, leaves, count);
    assert_int_equal(tree.level[0].count, count);
    for (int i = 0; i < count; i++) {
        assert_false(seen[tree.shape[i]]);
        seen[tree.shape[i]] = true;
        const struct bvh_leaf *leaf = &given[tree.shape[i]];
        const struct sphere_array *s = &tree.level[0];
        assert_true(s->x[i] == leaf->centre[0] && s->y[i] == leaf->centre[1] &&
                    s->z[i] == leaf->centre[2] && s->radius[i] == leaf->radius);
        if (!(reaches(tree.centre, &tree.level[0], i) <= (double)tree.radius))
            fail_msg("%d leaves: number %d reaches out of the sphere about all", count, i);
    }
    for (int level = 1; level < tree.levels; level++)
        for (int i = 0; i < tree.level[level - 1].count; i++) {
            const struct sphere_array *s = &tree.level[level];
            int node = i / BVH_WIDTH;
            float centre[3] = {s->x[node], s->y[node], s->z[node]};
            if (!(reaches(centre, &tree.level[level - 1], i) <= (double)s->radius[node]))
                fail_msg("%d leaves: entry %d of level %d reaches out of its node", count, i,
                         level - 1);
        }
    assert_true(tree.level[tree.levels - 1].count <= BVH_WIDTH); // all are below one node
    bvh_free(&tree);
}

TEST(every_sphere_holds_what_is_below) {
    const int counts[] = {1, 2, 16, 17, 255, 256, 257, 1000, MOST};
    for (size_t k = 0; k < LENGTH(counts); k++) {
        check(counts[k], 10, 0.2f);
        check(counts[k], 0, 1); // all at one place
        check(counts[k], 1e-3f, 20);
    }
}

RUN_TESTS(NULL, NULL)
