// Prepares groups: the balls of a union's children. No lanes in here.
#include "fields/field.h"
#include "groups/program.h"

#include <math.h>
#include <stdlib.h>

struct field_set {
    struct field *fields; // one per shape; not set of others than groups
    struct bvh_leaf *leaves;
    int shapes;
};

// Reserves the balls of a group with this root.
static bool reserve_balls(struct field *f, const struct node *root) {
    size_t children = (size_t)root->children;
    f->sphere = calloc(children + 1, sizeof *f->sphere);
    f->first = calloc(children + 1, sizeof *f->first);
    return bvh_reserve(&f->balls, root->children) && f->sphere && f->first;
}

struct field_set *fields_reserve(const struct model *model) {
    struct field_set *set = calloc(1, sizeof *set);
    if (!set)
        return NULL;
    size_t shapes = (size_t)model->shape_count, nodes = (size_t)model->node_count;
    set->fields = calloc(shapes, sizeof *set->fields);
    set->leaves = calloc(nodes + 1, sizeof *set->leaves);
    bool all = set->fields && set->leaves;
    for (int i = 0; all && i < model->shape_count; i++, set->shapes++)
        if (model->shapes[i].type == SHAPE_GROUP)
            all = reserve_balls(&set->fields[i], &model->nodes[model->shapes[i].group.root]);
    if (all)
        return set;
    fields_free(set);
    return NULL;
}

void fields_free(struct field_set *set) {
    if (!set)
        return;
    for (int i = 0; i < set->shapes; i++) {
        bvh_free(&set->fields[i].balls);
        free(set->fields[i].sphere);
        free(set->fields[i].first);
    }
    free(set->fields);
    free(set->leaves);
    free(set);
}

struct field *field_of(struct field_set *set, int i) {
    return &set->fields[i];
}

// Returns whether the group is a union of children that each have a ball (fields/rays.c), with nothing done to it.
static bool has_balls(const struct node *nodes, const struct node *root, const struct program *p) {
    if (root->operation != NODE_UNION || root->children < 2 || root->jumps ||
        p->steps[p->length - 1].kind != STEP_FOLD)
        return false;
    for (int i = (int)(root - nodes) + 1; i < root->end; i = nodes[i].end)
        if (!(nodes[i].radius < INFINITY))
            return false;
    return true;
}

// Returns the step behind a child's, which begin at `at`.
static int step_behind(const struct program *p, int at, int end_node) {
    while (at < p->length - 1 && p->steps[at].node < end_node)
        at++;
    return at;
}

static bool is_convex(enum shape_type type) {
    return type != SHAPE_TORUS && type != SHAPE_GROUP && (int)type != SHAPE_GYROID;
}

// A child's part of the surface is where its field is `drop` or less; where it is blend or more, it has none: PROOFS.md,
// 13.
static void set_balls(struct field *f, const struct model *model, int root_index,
                      struct bvh_leaf *leaves) {
    const struct node *nodes = model->nodes, *root = &nodes[root_index];
    double drop = root->blend / 2 * (1 - 1.0 / root->children), growth = 1;
    float radius[root->children];
    int step = 0, balls = 0;
    bool convex = true, spheres = root->blend > 0;
    for (int i = root_index + 1; i < root->end; i = nodes[i].end, balls++) {
        const struct node *n = &nodes[i];
        struct bvh_leaf *leaf = &leaves[balls];
        *leaf = (struct bvh_leaf){.shape = balls};
        for (int k = 0; k < 3; k++)
            leaf->centre[k] = (float)(n->centre[k] - (double)f->centre[k]);
        leaf->radius = (float)((n->radius + drop / n->growth) * (1 + 1e-5));
        f->first[balls] = step;
        int next = step_behind(f->program, step, n->end);
        bool sphere =
            n->operation == NODE_SHAPE && n->shape.type == SHAPE_SPHERE && next == step + 1;
        radius[balls] = sphere ? (float)n->shape.sphere.radius : 0.0f;
        spheres = spheres && sphere;
        convex = convex && next == step + 1 && is_convex(n->shape.type);
        step = next;
        growth = fmin(growth, n->growth);
    }
    f->first[balls] = step;
    bvh_build(&f->balls, leaves, balls);
    for (int i = 0; i < balls; i++)
        f->sphere[i] = radius[f->balls.shape[i]];
    f->grain = (float)root->blend;
    for (int i = 0; i < balls; i++)
        f->grain = fminf(f->grain, radius[i]);
    f->bend = convex && root->blend > 0 ? (float)(2 / root->blend) : 0.0f;
    f->wider = (float)((root->blend - drop) / growth * (1 + 1e-5));
    if (spheres) {
        f->blend = (float)root->blend;
        f->per_blend = (float)(1 / root->blend);
    }
}

void fields_prepare(struct field_set *set, const struct prepared *prepared, bool estimated) {
    const struct model *model = &prepared->model;
    for (int i = 0; i < model->shape_count; i++) {
        if (model->shapes[i].type != SHAPE_GROUP)
            continue;
        const struct primitive *p = &prepared->primitives[i];
        int index = model->shapes[i].group.root;
        const struct node *root = &model->nodes[index];
        struct field *f = &set->fields[i];
        f->program = p->program;
        f->radius = (float)root->radius;
        double share = root->growth / root->lipschitz;
        bool marched = estimated && !node_is_distance(model->nodes, index);
        f->share = (float)(share < 1 || marched ? share * (1 - 1e-5) : 1);
        f->lit_share = marched ? 0 : f->share;
        f->least = 0x1p-21f * (f->radius < INFINITY ? f->radius : 1.0f);
        f->floor = f->least * (root->lipschitz > 1 ? 0x1p6f : 0x1p12f); // what bends, bends near
        bool bounded = !p->repeated && root->radius < INFINITY;
        for (int k = 0; k < 3; k++)
            f->centre[k] = bounded ? (float)root->centre[k] : 0.0f;
        if (bounded && has_balls(model->nodes, root, f->program))
            set_balls(f, model, index, set->leaves);
    }
}
