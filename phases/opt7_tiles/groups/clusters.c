// See groups/clusters.h.
#include "groups/clusters.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LARGE_UNION = 48, CLUSTER = 16 };

// A shape's step, with its node's centre on the axis in work.
struct keyed {
    float key;
    struct step step;
};

static int by_key(const void *a, const void *b) {
    float one = ((const struct keyed *)a)->key, other = ((const struct keyed *)b)->key;
    return (one > other) - (one < other);
}

// Sorts along the axis on which the centres are furthest apart, halves, and so on down to clusters.
static void sort_shapes(struct keyed *shape, int count, const struct group_node *nodes) {
    if (count <= CLUSTER)
        return;
    int widest = 0;
    float most = -1;
    for (int axis = 0; axis < 3; axis++) {
        float low = INFINITY, high = -INFINITY;
        for (int i = 0; i < count; i++) {
            low = fminf(low, nodes[shape[i].step.node].centre[axis]);
            high = fmaxf(high, nodes[shape[i].step.node].centre[axis]);
        }
        widest = high - low > most ? axis : widest;
        most = fmaxf(most, high - low);
    }
    for (int i = 0; i < count; i++)
        shape[i].key = nodes[shape[i].step.node].centre[widest];
    qsort(shape, (size_t)count, sizeof *shape, by_key);
    int half = (count / 2 + CLUSTER - 1) / CLUSTER * CLUSTER;
    sort_shapes(shape, half, nodes);
    sort_shapes(shape + half, count - half, nodes);
}

static struct cluster bound_of(const struct keyed *shape, int count,
                               const struct group_node *nodes) {
    struct cluster c = {.growth = 1};
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++)
            c.centre[k] += nodes[shape[i].step.node].centre[k] / (float)count;
    for (int i = 0; i < count; i++) {
        const struct group_node *n = &nodes[shape[i].step.node];
        float apart[3];
        for (int k = 0; k < 3; k++)
            apart[k] = n->centre[k] - c.centre[k];
        float far = hypotf(hypotf(apart[0], apart[1]), apart[2]) + n->radius;
        c.radius = fmaxf(c.radius, far * (1 + 1e-5f));
        c.growth = fminf(c.growth, n->growth);
    }
    return c;
}

// Returns whether the fold at `at` is a large union of shapes, each a single step with a bound.
static bool is_large_union(const struct program *program, int at) {
    const struct step *fold = &program->steps[at];
    if (fold->kind != STEP_FOLD || fold->count < LARGE_UNION ||
        program->nodes[fold->node].operation != NODE_UNION)
        return false;
    for (int i = at - fold->count; i < at; i++) {
        const struct group_node *n = &program->nodes[program->steps[i].node];
        if (program->steps[i].kind != STEP_SHAPE || !(n->radius < INFINITY) || n->jumps)
            return false;
    }
    return true;
}

int cluster_shapes(struct program *program, struct step *steps, struct cluster *clusters) {
    int made = 0;
    for (int i = 0; i < program->length; i++) {
        if (!is_large_union(program, i))
            continue;
        int count = steps[i].count, here = (count + CLUSTER - 1) / CLUSTER;
        struct keyed *shape = malloc((size_t)count * sizeof *shape);
        if (!shape) // the program is right without clusters
            return made;
        for (int k = 0; k < count; k++)
            shape[k] = (struct keyed){0, steps[i - count + k]};
        sort_shapes(shape, count, program->nodes);
        memmove(steps + i + here, steps + i, (size_t)(program->length - i) * sizeof *steps);
        struct step *to = steps + i - count;
        for (int first = 0, left = here; first < count; first += CLUSTER, left--) {
            int some = count - first < CLUSTER ? count - first : CLUSTER;
            clusters[made] = bound_of(shape + first, some, program->nodes);
            clusters[made].left = left;
            *to++ = (struct step){STEP_CLUSTER, first == 0, (short)some, made++};
            for (int k = 0; k < some; k++)
                *to++ = shape[first + k].step;
        }
        free(shape);
        program->length += here;
        i += here;
    }
    return made;
}
