// Writes a group's tree as a program: postfix, with operands in floats.
#include "core/primitives.h"
#include "groups/clusters.h"
#include "groups/program.h"

#include <stdlib.h>

struct groups *groups_reserve(const struct model *model) {
    size_t nodes = (size_t)model->node_count;
    if (nodes == 0)
        return NULL;
    size_t programs = (size_t)model->features.groups;
    struct groups *groups = calloc(
        1, sizeof *groups + programs * sizeof *groups->programs + nodes * sizeof *groups->nodes +
               nodes * sizeof *groups->clusters + most_steps(nodes) * sizeof *groups->steps);
    if (!groups)
        return NULL;
    groups->programs = (struct program *)(groups + 1);
    groups->nodes = (struct group_node *)(groups->programs + programs);
    groups->clusters = (struct cluster *)(groups->nodes + nodes);
    groups->steps = (struct step *)(groups->clusters + nodes);
    return groups;
}

// Whether the field of a repeated node jumps at its cells' walls. A shape that is its own mirror image does not.
static bool jumps(const struct node *node) {
    const double *cell = node->shape.repeat;
    if (!(cell[0] > 0 || cell[1] > 0 || cell[2] > 0))
        return false;
    switch ((int)node->shape.type) {
    case SHAPE_SPHERE:
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX:
    case SHAPE_TORUS:
    case SHAPE_OCTAHEDRON:
    case SHAPE_CAPSULE:
    case SHAPE_ELLIPSOID:
        return node->operation != NODE_SHAPE || node->twist != 0 || node->amplitude > 0;
    default: return true;
    }
}

// Returns the next greater float: bounds must not shrink.
static float above(double a) {
    return nextafterf((float)a, INFINITY);
}

static struct group_node prepare_node(const struct node *node, const struct model *model) {
    struct group_node n = {.shape = prepare_shape(0, &node->shape, &model->march),
                           .operation = node->operation,
                           .blend = (float)node->blend,
                           .per_blend = node->blend > 0 ? (float)(1 / node->blend) : 0.0f,
                           .jumps = jumps(node),
                           .twist = (float)node->twist,
                           .twist_radius = (float)node->twist_radius,
                           .twist_inner = (float)node->twist_inner,
                           .amplitude = (float)node->amplitude,
                           .shell = (float)node->shell,
                           .offset = (float)node->offset,
                           .lipschitz = above(node->lipschitz),
                           .growth = (float)(node->growth * (1 - 1e-6)),
                           .radius = above(node->radius * (1 + 1e-6))};
    n.moved = n.shape.turned || n.shape.repeated;
    for (int i = 0; i < 3; i++) {
        n.mirror[i] = node->mirror[i];
        n.moved = n.moved || node->shape.position[i] != 0;
        n.frequency[i] = (float)node->frequency[i];
        n.centre[i] = (float)node->centre[i];
    }
    if (node->operation != NODE_SHAPE)
        return n;
    const struct material *m = &model->materials[node->shape.material];
    to_floats(m->color, n.color);
    n.reflectivity = (float)m->reflectivity;
    n.shininess = (float)m->shininess;
    return n;
}

// A program in work.
struct writer {
    const struct model *model;
    struct group_node *nodes;
    struct step *steps;
    struct program *program;
    int values, points; // on the stacks now
    bool bent;
};

static void write_step(struct writer *w, enum step_kind kind, bool first, int count, int node) {
    struct program *p = w->program;
    w->steps[p->length++] = (struct step){(unsigned char)kind, first, (short)count, node};
    w->values += kind == STEP_SHAPE ? 1 : kind == STEP_FOLD ? 1 - count : 0;
    w->points += kind == STEP_ENTER ? 1 : kind == STEP_LEAVE ? -1 : 0;
    p->shapes += kind == STEP_SHAPE;
    p->values = w->values > p->values ? w->values : p->values;
    p->points = w->points > p->points ? w->points : p->points;
}

// Writes a node, whose children's steps come before its own. Returns how far the coordinates in it reach, for the
// rounding error.
static float write_node(struct writer *w, int index) {
    const struct node *node = &w->model->nodes[index];
    struct group_node *n = &w->nodes[index];
    *n = prepare_node(node, w->model);
    n->bent = w->bent;
    bool changed = n->mirror[0] || n->mirror[1] || n->mirror[2] || n->twist != 0 ||
                   n->amplitude > 0 || n->shell > 0 || n->offset != 0;
    bool framed = changed || (n->operation != NODE_SHAPE && n->moved);
    float extent = 0, reach = 0;
    if (framed)
        write_step(w, STEP_ENTER, false, 0, index);
    if (n->operation == NODE_SHAPE) {
        write_step(w, STEP_SHAPE, framed || !n->moved, 0, index);
        extent = extent_of(&node->shape);
    }
    w->bent = w->bent || n->twist != 0 || n->shape.repeated;
    for (int i = index + 1; i < node->end; i = w->model->nodes[i].end) {
        extent = fmaxf(extent, write_node(w, i));
        n->jumps = n->jumps || w->nodes[i].jumps;
    }
    w->bent = n->bent;
    if (n->operation != NODE_SHAPE)
        write_step(w, STEP_FOLD, true, node->children, index);
    if (framed)
        write_step(w, STEP_LEAVE, false, 0, index);
    for (int i = 0; i < 3; i++)
        reach = hypotf(reach, (float)node->shape.position[i]);
    return reach + extent + n->amplitude + n->shell + fabsf(n->offset);
}

void compile_groups(struct prepared *prepared) {
    const struct model *model = &prepared->model;
    struct groups *groups = prepared->groups;
    struct step *next = groups ? groups->steps : NULL;
    struct cluster *clusters = groups ? groups->clusters : NULL;
    for (int i = 0, number = 0; groups && i < model->shape_count; i++) {
        struct primitive *primitive = &prepared->primitives[i];
        if (primitive->type != SHAPE_GROUP)
            continue;
        int root = model->shapes[i].group.root;
        const struct node *node = &model->nodes[root];
        struct program *p = &groups->programs[number++];
        *p = (struct program){.steps = next, .nodes = groups->nodes, .clusters = clusters};
        struct writer w = {model, groups->nodes, next, p, 0, 0, false};
        float extent = write_node(&w, root);
        p->scale = (float)(1 / node->lipschitz);
        p->radius = groups->nodes[root].radius;
        for (int k = 0; k < 3; k++)
            p->centre[k] = (float)node->centre[k];
        if (!(p->radius < INFINITY))
            extent = fmaxf(extent, (float)model->march.bounds_radius);
        p->error = 0x1p-18f * extent * (float)node->lipschitz;
        p->beside = 4.0f * (float)model->march.normal_step;
        clusters += cluster_shapes(p, next, clusters);
        next += p->length;
        primitive->program = p;
        primitive->steady = !primitive->repeated && !groups->nodes[root].jumps;
        primitive->slack = 0x1p-18f * extent;
    }
}
