// The march of rays that can hit nothing but a plane. Along the plane's normal the distance is linear in t, so a step
// is one multiply-add.
#include "core/packet_group.h"
#include "core/shape_distances.h"
#include "march/march.h"
#include "march/march_single.h"
#include "march/plane_step.h"

// Marches four packets from step number `next` on. They march abreast: the operations of each depend on each other, so
// the processor works on the others meanwhile.
static void march_four_to_plane(struct march_state packets[SMALL_GROUP], int first, int shape,
                                int next, struct packet_group *group, const struct model *model) {
    vfloat hit_distance = v_splat((float)model->march.hit_distance);
    struct plane_ray line[SMALL_GROUP];
    vmask begun[SMALL_GROUP];
    int cap = step_cap(model), left = cap, under_way = 0;
    for (int k = 0; k < SMALL_GROUP; k++) {
        const struct local_ray *a = &group->packet[first + k].local[shape];
        begun[k] = group->live[first + k];
        line[k] = (struct plane_ray){a->origin.x, a->direction.x, group->t[first + k],
                                     packets[k].exit, begun[k]};
        under_way += v_any(begun[k]);
        if (v_any(begun[k]) && packets[k].left < left)
            left = packets[k].left;
    }
    for (int step = next; under_way > 0; step++) {
        struct step_result stride[SMALL_GROUP];
        bool on = step < left;
        for (int k = 0; k < SMALL_GROUP; k++)
            stride[k] = step_to_plane(&line[k], hit_distance);
        for (int k = 0; k < SMALL_GROUP; k++)
            on = on && v_same(stride[k].inside, line[k].live);
        if (on)
            continue;
        for (int k = 0; k < SMALL_GROUP; k++) {
            if (!v_any(line[k].live) ||
                (v_same(stride[k].inside, line[k].live) && step < packets[k].left))
                continue;
            group->distance[first + k] = stride[k].distance;
            end_rays(&packets[k], step, first + k, stride[k].going, stride[k].inside, group, cap);
            line[k].live = group->live[first + k];
            under_way -= !v_any(line[k].live);
        }
    }
    for (int k = 0; k < SMALL_GROUP; k++)
        if (v_any(begun[k]))
            packets[k].t = line[k].t;
}

void march_to_plane(struct march_state *packets, int shape, int next, struct packet_group *group,
                    const struct model *model) {
    for (int first = 0; first < group->size; first += SMALL_GROUP)
        march_four_to_plane(packets + first, first, shape, next, group, model);
}
