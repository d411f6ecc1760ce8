// Builder of the hierarchy: first of two children a node, then of as many as there are lanes (tree.h has the sources).
#include "builders.h"

static float middle(const struct solid_in *s, int axis) {
    return 0.5f * s->box.lo[axis] + 0.5f * s->box.hi[axis];
}

struct pair {
    struct box box;
    int left; // the right one is next; 0: a leaf of `count` from `first`
    int first, count;
};

struct builder {
    struct tree *tree;
    const struct solid_in *solids;
    int *which; // numbers of solids
    struct pair *pairs;
    int pair_count;
};

struct cut {
    float cost; // INFINITY: there is none
    int axis, bin;
    float from, per; // bin = (middle − from)·per
};

static int bin_of(const struct cut *cut, const struct solid_in *s) {
    int bin = (int)((middle(s, cut->axis) - cut->from) * cut->per);
    return bin < 0 ? 0 : bin >= BINS ? BINS - 1 : bin;
}

static void try_axis(const struct builder *b, const struct pair *pair, struct cut try,
                     struct cut *best) {
    struct box box[BINS], right = NOWHERE;
    int count[BINS] = {0};
    float behind[BINS] = {0};
    for (int i = 0; i < BINS; i++)
        box[i] = NOWHERE;
    for (int i = pair->first; i < pair->first + pair->count; i++) {
        const struct solid_in *s = &b->solids[b->which[i]];
        int bin = bin_of(&try, s);
        count[bin]++;
        box[bin] = joined(box[bin], &s->box);
    }
    int after = 0;
    for (int i = BINS - 1; i > 0; i--) {
        right = joined(right, &box[i]);
        after += count[i];
        // Of solids, not of whole steps: what is left over fills a leaf beside.
        behind[i] = after ? area_of(&right) * (float)after : INFINITY;
    }
    struct box left = NOWHERE;
    int before = 0;
    for (int i = 0; i < BINS - 1; i++) {
        left = joined(left, &box[i]);
        before += count[i];
        float cost = before ? area_of(&left) * (float)before + behind[i + 1] : INFINITY;
        if (cost < best->cost) {
            *best = try;
            best->cost = cost;
            best->bin = i;
        }
    }
}

static struct cut best_cut(const struct builder *b, const struct pair *pair) {
    struct cut best = {.cost = INFINITY};
    for (int axis = 0; axis < 3; axis++) {
        float lo = INFINITY, hi = -INFINITY;
        for (int i = pair->first; i < pair->first + pair->count; i++) {
            float m = middle(&b->solids[b->which[i]], axis);
            lo = smaller(lo, m);
            hi = larger(hi, m);
        }
        if (hi > lo)
            try_axis(b, pair, (struct cut){INFINITY, axis, 0, lo, BINS / (hi - lo)}, &best);
    }
    return best;
}

// Puts those under the cut first; how many they are.
static int parted(struct builder *b, const struct pair *pair, const struct cut *cut) {
    int next = pair->first;
    for (int i = pair->first; i < pair->first + pair->count; i++)
        if (bin_of(cut, &b->solids[b->which[i]]) <= cut->bin) {
            int held = b->which[i];
            b->which[i] = b->which[next];
            b->which[next++] = held;
        }
    return next - pair->first;
}

// Two children a node, until a leaf is one group of lanes or no plane parts it.
static void halve(struct builder *b, int number, int depth) {
    struct pair *pair = &b->pairs[number];
    pair->box = NOWHERE;
    pair->left = 0;
    for (int i = pair->first; i < pair->first + pair->count; i++)
        pair->box = joined(pair->box, &b->solids[b->which[i]].box);
    int most = b->tree->width;
    if (pair->count <= most / 2 || depth == MOST_DEPTH)
        return;
    struct cut cut = best_cut(b, pair);
    if (cut.cost == INFINITY)
        return;
    float whole = area_of(&pair->box) * (float)pair->count;
    if (pair->count <= most && !(cut.cost < 0.75f * whole))
        return;
    int count = parted(b, pair, &cut), left = b->pair_count;
    b->pair_count += 2;
    pair->left = left;
    b->pairs[left] = (struct pair){.first = pair->first, .count = count};
    b->pairs[left + 1] = (struct pair){.first = pair->first + count, .count = pair->count - count};
    halve(b, left, depth + 1);
    halve(b, left + 1, depth + 1);
}

static void put_box(struct tree *tree, int node, int i, const struct box *box) {
    float *at = tree->boxes + (size_t)node * 6 * (size_t)tree->width + i;
    for (int k = 0; k < 3; k++) {
        at[k * tree->width] = box->lo[k];
        at[(3 + k) * tree->width] = box->hi[k];
    }
}

// The number of a new node, all of its children nowhere; −1 when memory is short.
static int add_node(struct tree *tree) {
    int room = tree->node_room;
    if (!grow(&tree->boxes, tree->nodes, &room, 6 * sizeof(float) * (size_t)tree->width))
        return -1;
    room = tree->node_room;
    if (!grow(&tree->child, tree->nodes, &room, sizeof(int) * (size_t)tree->width))
        return -1;
    tree->node_room = room;
    for (int i = 0; i < tree->width; i++) {
        put_box(tree, tree->nodes, i, &NOWHERE);
        tree->child[tree->nodes * tree->width + i] = 0;
    }
    return tree->nodes++;
}

// A node of as many children as it has room for: the largest is opened, again and again.
static int widen(struct builder *b, int number) {
    struct tree *tree = b->tree;
    int open[MOST_LANES] = {number}, count = 1, node = add_node(tree);
    if (node < 0)
        return -1;
    while (count < tree->width) {
        int largest = -1;
        float area = -1;
        for (int i = 0; i < count; i++)
            if (b->pairs[open[i]].left && area_of(&b->pairs[open[i]].box) > area) {
                largest = i;
                area = area_of(&b->pairs[open[i]].box);
            }
        if (largest < 0)
            break;
        int left = b->pairs[open[largest]].left;
        open[largest] = left;
        open[count++] = left + 1;
    }
    for (int i = 0; i < count; i++) {
        const struct pair *pair = &b->pairs[open[i]];
        int made = pair->left ? widen(b, open[i])
                              : add_leaf(tree, b->solids, b->which + pair->first, pair->count);
        if (made < 0)
            return -1;
        put_box(tree, node, i, &pair->box);
        tree->child[node * tree->width + i] = pair->left ? made : -1 - made;
    }
    return node;
}

bool build_bvh(struct tree *tree, const struct solid_in *solids, int *which, int count) {
    struct pair *pairs = calloc(2 * (size_t)count, sizeof *pairs);
    if (!pairs)
        return false;
    struct builder b = {tree, solids, which, pairs, 1};
    pairs[0] = (struct pair){.first = 0, .count = count};
    halve(&b, 0, 0);
    bool built = widen(&b, 0) >= 0;
    free(pairs);
    return built;
}
