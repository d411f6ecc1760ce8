// Prepares groups: their programs, and the balls of a union's children. No lanes in here.
#include "core/primitives.h"
#include "fields/field.h"
#include "groups/program.h"

#include <stdlib.h>

struct field_set {
    struct prepared programs; // of opt6_wide's files: model, primitives, groups
    struct field *fields;     // one per shape; not set of others than groups
    float *rows;
    int *first;
};

enum { BALL_ROOM = 16 }; // behind the balls of a group

struct field_set *fields_reserve(const struct model *model) {
    struct field_set *set = calloc(1, sizeof *set);
    if (!set)
        return NULL;
    size_t shapes = (size_t)model->shape_count, nodes = (size_t)model->node_count;
    size_t room = nodes + BALL_ROOM * (size_t)model->features.groups;
    set->programs.primitives = calloc(shapes, sizeof *set->programs.primitives);
    set->programs.groups = groups_reserve(model);
    set->fields = calloc(shapes, sizeof *set->fields);
    set->rows = calloc(room * BALL_ROWS + 1, sizeof *set->rows);
    set->first = calloc(room + 1, sizeof *set->first);
    if (set->programs.primitives && set->fields && set->rows && set->first &&
        (set->programs.groups || nodes == 0))
        return set;
    fields_free(set);
    return NULL;
}

void fields_free(struct field_set *set) {
    if (!set)
        return;
    free(set->programs.primitives);
    free(set->programs.groups);
    free(set->fields);
    free(set->rows);
    free(set->first);
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
static void set_balls(struct field *f, const struct model *model, int root_index) {
    const struct node *nodes = model->nodes, *root = &nodes[root_index];
    double drop = root->blend / 2 * (1 - 1.0 / root->children), growth = 1;
    int step = 0;
    bool convex = true;
    for (int i = root_index + 1; i < root->end; i = nodes[i].end) {
        const struct node *n = &nodes[i];
        for (int k = 0; k < 3; k++)
            f->ball[k][f->balls] = (float)(n->centre[k] - (double)f->centre[k]);
        f->ball[BALL_RADIUS][f->balls] = (float)((n->radius + drop / n->growth) * (1 + 1e-5));
        f->first[f->balls] = step;
        int next = step_behind(f->program, step, n->end);
        bool sphere =
            n->operation == NODE_SHAPE && n->shape.type == SHAPE_SPHERE && next == step + 1;
        f->ball[BALL_SPHERE][f->balls++] = sphere ? (float)n->shape.sphere.radius : 0.0f;
        convex = convex && next == step + 1 && is_convex(n->shape.type);
        step = next;
        growth = fmin(growth, n->growth);
    }
    f->first[f->balls] = step;
    f->bend = convex && root->blend > 0 ? (float)(2 / root->blend) : 0.0f;
    f->wider = (float)((root->blend - drop) / growth * (1 + 1e-5));
}

void fields_prepare(struct field_set *set, const struct model *model) {
    set->programs.model = *model;
    for (int i = 0; i < model->shape_count; i++)
        set->programs.primitives[i] = prepare_shape(i, &model->shapes[i], &model->march);
    compile_groups(&set->programs);
    size_t at = 0;
    for (int i = 0; i < model->shape_count; i++) {
        if (model->shapes[i].type != SHAPE_GROUP)
            continue;
        const struct primitive *p = &set->programs.primitives[i];
        int index = model->shapes[i].group.root;
        const struct node *root = &model->nodes[index];
        struct field *f = &set->fields[i];
        *f = (struct field){.program = p->program, .radius = (float)root->radius};
        f->least = 0x1p-21f * (f->radius < INFINITY ? f->radius : 1.0f);
        bool bounded = !p->repeated && root->radius < INFINITY;
        for (int k = 0; k < 3; k++)
            f->centre[k] = bounded ? (float)root->centre[k] : 0.0f;
        size_t room = (size_t)(root->end - index) + BALL_ROOM;
        for (int k = 0; k < BALL_ROWS; k++)
            f->ball[k] = set->rows + at * BALL_ROWS + (size_t)k * room;
        f->first = set->first + at;
        at += room;
        if (bounded && has_balls(model->nodes, root, f->program))
            set_balls(f, model, index);
    }
}
