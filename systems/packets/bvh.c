// Builds the BVH: first with two children a node, then collapsed to as many as there are lanes
// (sources: tree.h).
#include "builders.h"

static float middle(const struct bounded_solid *s, int axis) {
    return 0.5f * s->box.lo[axis] + 0.5f * s->box.hi[axis];
}

struct binary_node {
    struct box box;
    int left;         // child, the right one is next; 0: a leaf
    int first, count; // its solids in `which`
};

struct builder {
    struct tree *tree;
    const struct bounded_solid *solids;
    int *which; // numbers of solids
    struct binary_node *nodes;
    int node_count;
};

struct split {
    float cost; // INFINITY: no split
    int axis, bin;
    float from, per; // bin = (middle − from)·per
};

static int bin_of(const struct split *split, const struct bounded_solid *s) {
    int bin = (int)((middle(s, split->axis) - split->from) * split->per);
    return bin < 0 ? 0 : bin >= BINS ? BINS - 1 : bin;
}

static void try_axis(const struct builder *b, const struct binary_node *node, struct split try,
                     struct split *best) {
    struct box box[BINS], right = EMPTY_BOX;
    int count[BINS] = {0};
    float behind[BINS] = {0};
    for (int i = 0; i < BINS; i++)
        box[i] = EMPTY_BOX;
    for (int i = node->first; i < node->first + node->count; i++) {
        const struct bounded_solid *s = &b->solids[b->which[i]];
        int bin = bin_of(&try, s);
        count[bin]++;
        box[bin] = box_union(box[bin], &s->box);
    }
    int after = 0;
    for (int i = BINS - 1; i > 0; i--) {
        right = box_union(right, &box[i]);
        after += count[i];
        // Counts solids, not groups of lanes: a part of a group can fill up a leaf elsewhere.
        behind[i] = after ? box_area(&right) * (float)after : INFINITY;
    }
    struct box left = EMPTY_BOX;
    int before = 0;
    for (int i = 0; i < BINS - 1; i++) {
        left = box_union(left, &box[i]);
        before += count[i];
        float cost = before ? box_area(&left) * (float)before + behind[i + 1] : INFINITY;
        if (cost < best->cost) {
            *best = try;
            best->cost = cost;
            best->bin = i;
        }
    }
}

static struct split best_split(const struct builder *b, const struct binary_node *node) {
    struct split best = {.cost = INFINITY};
    for (int axis = 0; axis < 3; axis++) {
        float lo = INFINITY, hi = -INFINITY;
        for (int i = node->first; i < node->first + node->count; i++) {
            float m = middle(&b->solids[b->which[i]], axis);
            lo = float_min(lo, m);
            hi = float_max(hi, m);
        }
        if (hi > lo)
            try_axis(b, node, (struct split){INFINITY, axis, 0, lo, BINS / (hi - lo)}, &best);
    }
    return best;
}

// Moves the solids below the split to the front of `which`. Returns their number.
static int partition(struct builder *b, const struct binary_node *node, const struct split *split) {
    int next = node->first;
    for (int i = node->first; i < node->first + node->count; i++)
        if (bin_of(split, &b->solids[b->which[i]]) <= split->bin) {
            int held = b->which[i];
            b->which[i] = b->which[next];
            b->which[next++] = held;
        }
    return next - node->first;
}

// Splits a node and its children, until a leaf is one group of lanes or no plane divides it.
static void split_node(struct builder *b, int number, int depth) {
    struct binary_node *node = &b->nodes[number];
    node->box = EMPTY_BOX;
    node->left = 0;
    for (int i = node->first; i < node->first + node->count; i++)
        node->box = box_union(node->box, &b->solids[b->which[i]].box);
    int most = b->tree->width;
    if (node->count <= most / 2 || depth == MAX_DEPTH)
        return;
    struct split split = best_split(b, node);
    if (split.cost == INFINITY)
        return;
    float whole = box_area(&node->box) * (float)node->count;
    if (node->count <= most && !(split.cost < 0.75f * whole))
        return;
    int count = partition(b, node, &split), left = b->node_count;
    b->node_count += 2;
    node->left = left;
    b->nodes[left] = (struct binary_node){.first = node->first, .count = count};
    b->nodes[left + 1] =
        (struct binary_node){.first = node->first + count, .count = node->count - count};
    split_node(b, left, depth + 1);
    split_node(b, left + 1, depth + 1);
}

static void set_child_box(struct tree *tree, int node, int i, const struct box *box) {
    float *at = tree->boxes + (size_t)node * 6 * (size_t)tree->width + i;
    for (int k = 0; k < 3; k++) {
        at[k * tree->width] = box->lo[k];
        at[(3 + k) * tree->width] = box->hi[k];
    }
}

// Adds a node without children. Returns its number, −1 if memory is short.
static int add_node(struct tree *tree) {
    int room = tree->node_room;
    if (!reserve_one(&tree->boxes, tree->nodes, &room, 6 * sizeof(float) * (size_t)tree->width))
        return -1;
    room = tree->node_room;
    if (!reserve_one(&tree->child, tree->nodes, &room, sizeof(int) * (size_t)tree->width))
        return -1;
    tree->node_room = room;
    for (int i = 0; i < tree->width; i++) {
        set_child_box(tree, tree->nodes, i, &EMPTY_BOX);
        tree->child[tree->nodes * tree->width + i] = 0;
    }
    return tree->nodes++;
}

// Makes one wide node of a binary one: opens the largest child until the node is full. Returns its
// number, −1 if memory is short.
static int collapse_node(struct builder *b, int number) {
    struct tree *tree = b->tree;
    int open[MAX_LANES] = {number}, count = 1, node = add_node(tree);
    if (node < 0)
        return -1;
    while (count < tree->width) {
        int largest = -1;
        float area = -1;
        for (int i = 0; i < count; i++)
            if (b->nodes[open[i]].left && box_area(&b->nodes[open[i]].box) > area) {
                largest = i;
                area = box_area(&b->nodes[open[i]].box);
            }
        if (largest < 0)
            break;
        int left = b->nodes[open[largest]].left;
        open[largest] = left;
        open[count++] = left + 1;
    }
    for (int i = 0; i < count; i++) {
        const struct binary_node *from = &b->nodes[open[i]];
        int made = from->left ? collapse_node(b, open[i])
                              : add_leaf(tree, b->solids, b->which + from->first, from->count);
        if (made < 0)
            return -1;
        set_child_box(tree, node, i, &from->box);
        tree->child[node * tree->width + i] = from->left ? made : -1 - made;
    }
    return node;
}

bool build_bvh(struct tree *tree, const struct bounded_solid *solids, int *which, int count) {
    struct binary_node *nodes = calloc(2 * (size_t)count, sizeof *nodes);
    if (!nodes)
        return false;
    struct builder b = {tree, solids, which, nodes, 1};
    nodes[0] = (struct binary_node){.first = 0, .count = count};
    split_node(&b, 0, 0);
    bool built = collapse_node(&b, 0) >= 0;
    free(nodes);
    return built;
}
