// Runs the programs of groups: see groups/field.h.
#include "groups/field.h"
#include "core/sdf.h"
#include "groups/choice.h"

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

vfloat field_at(const struct local_ray *a, vfloat t, struct vec p,
                const struct primitive *primitive, vmask live) {
    vfloat result;
    field_values(program_of_ray(a, t, live, primitive), &p, 1, &result);
    return result;
}

void field_distances(struct packet_group *group, int shape, const struct primitive *primitive,
                     struct nearest_so_far *found) {
    struct vec at[GROUP];
    vfloat distance[GROUP];
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        const struct local_ray *a = &group->packet[k].local[shape];
        at[i] = vec_along(a->origin, a->direction, group->t[k]);
        if (primitive->repeated)
            at[i] = vec_wrapped(primitive, at[i]);
    }
    field_values(program_of_packets(group, shape, primitive), at, group->count, distance);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        vfloat sum = distance[i] + group->t[k];
        found->least[k] = v_min(distance[i], found->least[k]);
        found->limit[k] = v_min(sum, found->limit[k]);
        if (primitive->steady)
            *wake_of(&group->packet[k], shape) = wake_bound(sum, primitive);
    }
}
