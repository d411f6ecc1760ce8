// Builders of the trees. Both choose planes among BINS per axis.
#include "tree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BINS = 16 };

// Of the kd-tree: a node beside the test of a group of shapes, and what cutting off empty space is worth (Wald and
// Havran).
static const float KD_NODE_COST = 0.5f, EMPTY_GAIN = 0.8f;

static const struct box NOWHERE = {{INFINITY, INFINITY, INFINITY},
                                   {-INFINITY, -INFINITY, -INFINITY}};

static struct box joined(struct box a, const struct box *b) {
    for (int k = 0; k < 3; k++) {
        a.lo[k] = smaller(a.lo[k], b->lo[k]);
        a.hi[k] = larger(a.hi[k], b->hi[k]);
    }
    return a;
}

static float area_of(const struct box *b) {
    float x = b->hi[0] - b->lo[0], y = b->hi[1] - b->lo[1], z = b->hi[2] - b->lo[2];
    return x >= 0 ? x * y + y * z + z * x : 0;
}

// Room for one more of `size` bytes. False when memory is short.
static bool grow(void *array, int count, int *room, size_t size) {
    if (count < *room)
        return true;
    int wanted = *room ? 2 * *room : 64;
    void *old, *made;
    memcpy(&old, array, sizeof old);
    made = realloc(old, (size_t)wanted * size);
    if (!made)
        return false;
    memcpy(array, &made, sizeof made);
    *room = wanted;
    return true;
}

static const int FIELDS[SOLIDS] = {4, 15, 15};

// All arrays of a type are as long, and MOST_LANES longer than what is in them: a group of lanes may be loaded at the
// last one.
static bool grow_hot(struct hot *hot, int type) {
    if (hot->count + MOST_LANES < hot->room)
        return true;
    int room = hot->room ? 2 * hot->room : 4 * MOST_LANES;
    float **arrays[MOST_FIELDS + 4];
    int count = 0;
    for (int f = 0; f < FIELDS[type]; f++)
        arrays[count++] = &hot->field[f];
    for (int k = 0; k < 3; k++)
        arrays[count++] = &hot->reach[k];
    arrays[count++] = &hot->index;
    for (int i = 0; i < count; i++) {
        float *made = realloc(*arrays[i], (size_t)room * sizeof(float));
        if (!made)
            return false;
        memset(made + hot->room, 0, (size_t)(room - hot->room) * sizeof(float));
        *arrays[i] = made;
    }
    hot->room = room;
    return true;
}

static bool add_hot(struct tree *tree, const struct solid_in *s) {
    struct hot *hot = &tree->hot[s->type];
    if (!grow_hot(hot, (int)s->type))
        return false;
    int at = hot->count++;
    for (int f = 0; f < FIELDS[s->type]; f++)
        hot->field[f][at] = s->field[f];
    for (int k = 0; k < 3; k++)
        hot->reach[k][at] =
            larger(s->box.hi[k] - s->field[F_CENTRE + k], s->field[F_CENTRE + k] - s->box.lo[k]);
    hot->index[at] = (float)s->index;
    return true;
}

// The number of a new leaf of these; −1 when memory is short.
static int add_leaf(struct tree *tree, const struct solid_in *solids, const int *which, int count) {
    if (!grow(&tree->leaf, tree->leaves, &tree->leaf_room, sizeof *tree->leaf))
        return -1;
    struct leaf leaf;
    for (int type = 0; type < SOLIDS; type++) {
        leaf.first[type] = tree->hot[type].count;
        for (int i = 0; i < count; i++)
            if ((int)solids[which[i]].type == type && !add_hot(tree, &solids[which[i]]))
                return -1;
        leaf.count[type] = tree->hot[type].count - leaf.first[type];
    }
    tree->leaf[tree->leaves] = leaf;
    return tree->leaves++;
}

static float middle(const struct solid_in *s, int axis) {
    return 0.5f * s->box.lo[axis] + 0.5f * s->box.hi[axis];
}

// --- The hierarchy: first of two children a node, then of as many as there are lanes.

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

static bool build_bvh(struct tree *tree, const struct solid_in *solids, int *which, int count) {
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

// --- The kd-tree. A solid is in every leaf that its box reaches into.

struct plane {
    float cost, at;
    int axis; // −1: a leaf is cheaper
};

// Of BINS − 1 planes, by how many boxes begin below and end above each.
static void try_planes(const struct tree *tree, const struct solid_in *solids, const int *which,
                       int count, const struct box *cell, int axis, struct plane *best) {
    float lo = cell->lo[axis], width = cell->hi[axis] - lo, per = BINS / width;
    if (!(width > 0) || !(per < INFINITY))
        return;
    int begin[BINS + 1] = {0}, end[BINS + 1] = {0};
    for (int i = 0; i < count; i++) {
        const struct box *box = &solids[which[i]].box;
        float from = (box->lo[axis] - lo) * per, to = (box->hi[axis] - lo) * per;
        begin[from > 0 ? (from < BINS ? (int)from : BINS - 1) : 0]++;
        end[to > 0 ? (to < BINS ? (int)to : BINS - 1) : 0]++;
    }
    float whole = area_of(cell);
    int left = 0, right = count;
    for (int bin = 1; bin < BINS; bin++) {
        left += begin[bin - 1];
        right -= end[bin - 1];
        struct box below = *cell, above = *cell;
        float at = lo + width * (float)bin / BINS;
        if (!(at > lo && at < cell->hi[axis]))
            continue;
        below.hi[axis] = above.lo[axis] = at;
        float cost = (area_of(&below) * (float)left + area_of(&above) * (float)right) /
                     (whole * (float)tree->width / 4);
        cost = KD_NODE_COST + (left && right ? 1 : EMPTY_GAIN) * cost;
        if (cost < best->cost)
            *best = (struct plane){cost, at, axis};
    }
}

static bool split_cell(struct tree *tree, const struct solid_in *solids, const int *which,
                       int count, struct box cell, int node, int depth) {
    struct plane best = {(float)count / ((float)tree->width / 4), 0, -1};
    if (depth > 0 && count > 1)
        for (int axis = 0; axis < 3; axis++)
            try_planes(tree, solids, which, count, &cell, axis, &best);
    if (best.axis < 0) {
        int leaf = add_leaf(tree, solids, which, count);
        tree->kd[node] = (struct kd_node){0, 3, leaf};
        return leaf >= 0;
    }
    int below = tree->kds;
    for (int i = 0; i < 2; i++)
        if (!grow(&tree->kd, tree->kds++, &tree->kd_room, sizeof *tree->kd))
            return false;
    tree->kd[node] = (struct kd_node){best.at, best.axis, below};
    int *part = malloc((size_t)count * sizeof *part + 1);
    bool built = part != NULL;
    for (int side = 0; side < 2 && built; side++) {
        struct box half = cell;
        (side ? half.lo : half.hi)[best.axis] = best.at;
        int in = 0;
        for (int i = 0; i < count; i++) {
            const struct box *box = &solids[which[i]].box;
            if (side ? box->hi[best.axis] >= best.at : box->lo[best.axis] <= best.at)
                part[in++] = which[i];
        }
        built = split_cell(tree, solids, part, in, half, below + side, depth - 1);
    }
    free(part);
    return built;
}

static bool build_kd(struct tree *tree, const struct solid_in *solids, const int *which,
                     int count) {
    if (!grow(&tree->kd, tree->kds++, &tree->kd_room, sizeof *tree->kd))
        return false;
    int depth = 8;
    for (int i = count; i > 1; i /= 2)
        depth++;
    return split_cell(tree, solids, which, count, tree->bounds, 0, depth);
}

bool tree_build(struct tree *tree, enum tree_kind kind, int width, const struct solid_in *solids,
                int count) {
    tree->kind = kind;
    tree->width = width;
    tree->bounds = NOWHERE;
    tree->nodes = tree->kds = tree->leaves = 0;
    for (int type = 0; type < SOLIDS; type++)
        tree->hot[type].count = 0;
    int *which = malloc((size_t)count * sizeof *which + 1);
    if (!which)
        return false;
    for (int i = 0; i < count; i++) {
        which[i] = i;
        tree->bounds = joined(tree->bounds, &solids[i].box);
    }
    bool built = true;
    if (count > 0 && kind == TREE_BVH)
        built = build_bvh(tree, solids, which, count);
    else if (count > 0 && kind == TREE_KD)
        built = build_kd(tree, solids, which, count);
    else if (count > 0)
        built = add_leaf(tree, solids, which, count) >= 0;
    free(which);
    return built;
}

void tree_free(struct tree *tree) {
    for (int type = 0; type < SOLIDS; type++) {
        struct hot *hot = &tree->hot[type];
        for (int f = 0; f < MOST_FIELDS; f++)
            free(hot->field[f]);
        for (int k = 0; k < 3; k++)
            free(hot->reach[k]);
        free(hot->index);
    }
    free(tree->boxes);
    free(tree->child);
    free(tree->kd);
    free(tree->leaf);
}
