// Distances and parts of groups for packets of rays: see groups/field.h.
#include "core/sdf.h"
#include "groups/choice.h"
#include "groups/field.h"

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

struct field_part field_at_origin(const struct local_ray *a, const struct primitive *primitive,
                                  vmask found) {
    const struct program *program = program_of_ray(a, v_splat(0.0f), found, primitive);
    return field_parts(program, a->origin);
}
