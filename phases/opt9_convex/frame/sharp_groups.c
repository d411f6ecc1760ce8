// Takes a group's tree apart into leaves, and makes it a union of parts (hit/sharp.h). No vectors in here.
#include "frame/prepare.h"
#include "hit/sharp.h"
#include "scene/shadow_bounds.h"
#include "scene/vector.h"

#include <math.h>
#include <string.h>

// A frame: q = turn·p + moved.
struct placed {
    double turn[3][3], moved[3];
};

struct taker {
    const struct node *nodes;
    struct sharp *sharp;
    bool fits;
};

// Adds a leaf of a node (−1: of none), and the part that it is: where a node is taken away, what is outside of it.
static struct primitive *add_leaf(struct taker *w, int node, bool removes) {
    struct sharp *sharp = w->sharp;
    w->fits = w->fits && sharp->leaves < SHARP_LEAVES && sharp->parts < SHARP_PARTS;
    if (!w->fits)
        return NULL;
    unsigned bit = 1u << sharp->leaves;
    sharp->shape[sharp->leaves] = NULL;
    sharp->part[sharp->parts++] =
        (struct sharp_part){.kept = removes ? 0 : bit, .cut = removes ? bit : 0};
    struct primitive *leaf = &sharp->leaf[sharp->leaves++];
    *leaf = (struct primitive){.index = (float)node};
    return leaf;
}

// Replaces the parts from `first` on by what each of them has in common with each of those from `second` on.
static void intersect_parts(struct taker *w, int first, int second) {
    struct sharp_part all[SHARP_PARTS], *part = w->sharp->part;
    int count = 0, most = (second - first) * (w->sharp->parts - second);
    w->fits = w->fits && most <= SHARP_PARTS - first;
    for (int i = first; i < second && w->fits; i++)
        for (int k = second; k < w->sharp->parts; k++)
            all[count++] =
                (struct sharp_part){part[i].kept | part[k].kept, part[i].cut | part[k].cut};
    w->sharp->parts = first + count;
    memcpy(part + first, all, (size_t)count * sizeof *all);
}

// Adds the half-space normal·q ≤ offset.
static void add_plane(struct taker *w, const struct placed *at, const double normal[3],
                      double offset, int node, bool removes) {
    struct primitive *p = add_leaf(w, node, removes);
    if (!p)
        return;
    p->type = SHAPE_PLANE;
    p->eval = EVAL_LINEAR;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++)
            p->normal[k] += (float)(at->turn[i][k] * normal[i]);
        offset -= normal[k] * at->moved[k];
    }
    p->c = (float)offset;
}

static void add_solid(struct taker *w, const struct placed *at, int node, bool removes) {
    const struct shape *shape = &w->nodes[node].shape;
    struct primitive *p = add_leaf(w, node, removes);
    if (!p)
        return;
    w->sharp->shape[w->sharp->leaves - 1] = shape;
    p->eval = EVAL_POINT;
    for (int k = 0; k < 3; k++) {
        double position = 0;
        for (int i = 0; i < 3; i++) {
            position -= at->turn[i][k] * at->moved[i];
            p->turn[k][i] = (float)at->turn[k][i];
            p->turned =
                p->turned || (shape->type != SHAPE_SPHERE && at->turn[k][i] != (double)(i == k));
        }
        p->position[k] = (float)position;
    }
}

// Returns whether the node's solid, before its mirror, has no point at −x (y, z by axis).
static bool is_beside(const struct node *nodes, int index, int axis) {
    const struct node *node = &nodes[index];
    int end = node->operation == NODE_DIFFERENCE ? nodes[index + 1].end : node->end;
    for (int i = index + 1; i < end; i = nodes[i].end)
        if (nodes[i].centre[axis] < nodes[i].radius)
            return false;
    return node->operation != NODE_SHAPE;
}

static void take_node(struct taker *w, int index, struct placed at, bool removes);

static void take_inside(struct taker *w, int index, const struct placed *at, bool removes) {
    const struct node *node = &w->nodes[index];
    int first = w->sharp->parts;
    if (node->shape.type == SHAPE_PLANE)
        add_plane(w, at, node->shape.plane.normal, node->shape.plane.offset, index, removes);
    else if (node->operation == NODE_SHAPE)
        add_solid(w, at, index, removes);
    for (int i = index + 1; i < node->end && w->fits; i = w->nodes[i].end) {
        int second = w->sharp->parts;
        take_node(w, i, *at, removes != (node->operation == NODE_DIFFERENCE && i != index + 1));
        if (second > first && removes == (node->operation == NODE_UNION))
            intersect_parts(w, first, second);
    }
}

// Returns whether a leaf of this type is convex and known to hit/sharp.c.
static bool has_span(const struct node *node) {
    enum shape_type type = node->shape.type;
    return node->operation != NODE_SHAPE || (int)type == SHAPE_CAPSULE ||
           (type != SHAPE_TORUS && type != SHAPE_ROUNDED_BOX && type < SHAPE_MANDELBULB);
}

static void take_node(struct taker *w, int index, struct placed at, bool removes) {
    const struct node *node = &w->nodes[index];
    const double *cell = node->shape.repeat;
    w->fits = w->fits && has_span(node) && !(node->blend > 0 && node->children > 1) &&
              node->twist == 0 && node->amplitude == 0 && node->shell == 0 && node->offset == 0 &&
              !(cell[0] > 0 || cell[1] > 0 || cell[2] > 0);
    double turn[3][3];
    rotation_matrix(node->shape.rotation_degrees, turn);
    struct placed to = {0};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            to.moved[i] += turn[i][k] * (at.moved[k] - node->shape.position[k]);
            for (int j = 0; j < 3; j++)
                to.turn[i][j] += turn[i][k] * at.turn[k][j];
        }
    int first = w->sharp->parts,
        images = 1 << (node->mirror[0] + node->mirror[1] + node->mirror[2]);
    for (int image = 0; image < images && w->fits; image++) {
        struct placed seen = to;
        int bit = 0;
        for (int axis = 0; axis < 3; axis++) {
            bool back = node->mirror[axis] && image >> bit & 1;
            bit += node->mirror[axis];
            seen.moved[axis] *= back ? -1 : 1;
            for (int j = 0; j < 3; j++)
                seen.turn[axis][j] *= back ? -1 : 1;
        }
        int second = w->sharp->parts;
        take_inside(w, index, &seen, removes);
        for (int axis = 0; axis < 3 && w->fits; axis++)
            if (node->mirror[axis] && !is_beside(w->nodes, index, axis)) {
                double normal[3] = {-(axis == 0), -(axis == 1), -(axis == 2)};
                int plane = w->sharp->parts;
                add_plane(w, &seen, normal, 0, -1, removes);
                if (!removes)
                    intersect_parts(w, second, plane);
            }
        if (image > 0 && removes)
            intersect_parts(w, first, second);
    }
}

static double bound_of(const struct shape *shape) {
    return shape ? bounding_radius(shape) : INFINITY;
}

static unsigned swapped(unsigned bits, int i) {
    unsigned two = (bits >> i ^ bits >> (i + 1)) & 1;
    return bits ^ (two << i | two << (i + 1));
}

// Small leaves first: rays miss them more often, and then the part.
static void sort_leaves(struct sharp *sharp) {
    for (int end = sharp->leaves - 1; end > 0; end--)
        for (int i = 0; i < end; i++) {
            const struct shape *first = sharp->shape[i];
            if (!(bound_of(first) > bound_of(sharp->shape[i + 1])))
                continue;
            struct primitive leaf = sharp->leaf[i];
            sharp->leaf[i] = sharp->leaf[i + 1];
            sharp->leaf[i + 1] = leaf;
            sharp->shape[i] = sharp->shape[i + 1];
            sharp->shape[i + 1] = first;
            for (int k = 0; k < sharp->parts; k++) {
                sharp->part[k].kept = swapped(sharp->part[k].kept, i);
                sharp->part[k].cut = swapped(sharp->part[k].cut, i);
            }
        }
}

bool take_sharp(struct sharp *sharp, const struct shape *group, const float centre[3]) {
    struct taker w = {group->group.nodes, sharp, true};
    sharp->leaves = sharp->parts = 0;
    struct placed at = {.turn = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                        .moved = {(double)centre[0], (double)centre[1], (double)centre[2]}};
    take_node(&w, group->group.root, at, false);
    sort_leaves(sharp);
    return w.fits;
}
