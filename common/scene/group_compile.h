// Compiles a group's tree into a program in postfix order, as opt2 to opt4 run it. Included by the phase's source: its are
// struct instruction, struct primitive and PRIMITIVE_OF(shape).
#pragma once

#include <string.h>

// Appends the instructions of the node and its children, which read their point from `frame`. Returns the end.
static struct instruction *compile(const struct model *model, int index, int frame,
                                   struct instruction *out) {
    const struct node *node = &model->nodes[index];
    struct primitive primitive = PRIMITIVE_OF(&node->shape);
    const double *at = node->shape.position;
    bool leaf = node->operation == NODE_SHAPE, bent = node->twist != 0.0 || node->amplitude > 0.0;
    bool moved = primitive.rotated || primitive.repeated || at[0] || at[1] || at[2];
    if (node->mirror[0] || node->mirror[1] || node->mirror[2] || (moved && (!leaf || bent))) {
        *out++ = (struct instruction){TO_FRAME, frame++, primitive, node};
        memset(primitive.position, 0, sizeof primitive.position);
        primitive.rotated = primitive.repeated = false;
    }
    int inner = frame;
    if (node->twist != 0.0)
        *out++ = (struct instruction){TWIST, inner++, primitive, node};
    for (int child = index + 1; child < node->end; child = model->nodes[child].end)
        out = compile(model, child, inner, out);
    *out++ = (struct instruction){leaf ? LEAF : FOLD, inner, primitive, node};
    if (bent || node->shell > 0.0 || node->offset != 0.0)
        *out++ = (struct instruction){MODIFY, frame, primitive, node};
    return out;
}

static struct instruction *group_compile(const struct model *model, int root,
                                         struct primitive *group, struct instruction *out) {
    struct instruction *end = compile(model, root, 0, out);
    group->group.program = out;
    group->group.length = (int)(end - out);
    group->group.inv_lipschitz = 1.0 / model->nodes[root].lipschitz;
    return end;
}
