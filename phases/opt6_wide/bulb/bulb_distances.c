// Distances of a Mandelbulb for a group of packets.
#include "core/packet_group.h"
#include "core/sdf.h"
#include "core/shape_distances.h"

// Evaluates a Mandelbulb for all packets, iterated in turn. One iteration is a chain of a hundred cycles, too long for
// the processor to look beyond it to the next packet's.
void bulb_distances(struct packet_group *group, int shape, const struct primitive *primitive,
                    struct nearest_so_far *found) {
    struct bulb_orbit bulb[GROUP];
    int count = group->count;
    for (int i = 0; i < count; i++) {
        int k = group->marching[i];
        const struct local_ray *a = &group->packet[k].local[shape];
        struct vec p = vec_along(a->origin, a->direction, group->t[k]);
        bulb[i] = bulb_start(primitive->repeated ? vec_wrapped(primitive, p) : p, group->live[k]);
        if (!primitive->repeated)
            *wake_of(&group->packet[k], shape) = bulb_wake_bound(bulb[i].m, group->t[k]);
    }
    for (int n = 0; n < primitive->iterations; n++) {
        vmask inside = v_mask_none();
        for (int i = 0; i < count; i++) {
            bulb_iterate(&bulb[i], v_splat(primitive->bailout));
            inside = v_or(inside, bulb[i].inside);
        }
        if (!v_any(inside))
            break;
    }
    for (int i = 0; i < count; i++) {
        int k = group->marching[i];
        vfloat distance = bulb_estimate(&bulb[i]);
        found->least[k] = v_min(distance, found->least[k]);
        found->limit[k] = v_min(distance + group->t[k], found->limit[k]);
    }
}
