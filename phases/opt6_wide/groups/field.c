// Runs the programs of groups: see groups/field.h.
#include "groups/field.h"

#include <string.h>

// Each step is taken for all points before the next, because the operations of one wait for each other.
void field_values(const struct program *program, const struct vec *at, int count, vfloat *result) {
    ACTIVE(LANES);
    vfloat stack[program->values * count], *top = stack;
    struct vec points[(program->points + 1) * count], *p = points;
    memcpy(points, at, (size_t)count * sizeof *at);
    for (int i = 0; i < program->length; i++) {
        const struct step *step = &program->steps[i];
        const struct group_node *n = &program->nodes[step->node];
        switch (step->kind) {
        case STEP_SHAPE:
            shape_distances(step, n, p, count, top);
            top += count;
            break;
        case STEP_ENTER:
            for (int k = 0; k < count; k++)
                enter_node(n, &p[k], &p[count + k]);
            p += count;
            break;
        case STEP_FOLD:
            top -= step->count * count;
            for (int k = 0; k < count; k++)
                top[k] = folded_distance(step, n, count, top + k);
            top += count;
            break;
        case STEP_LEAVE:
            p -= count;
            for (int k = 0; k < count; k++)
                top[k - count] = leave_node(n, &p[k], top[k - count]);
            break;
        default: break;
        }
    }
    for (int k = 0; k < count; k++)
        result[k] = stack[k] * v_splat(program->scale);
}
