// The march of rays that can hit nothing but a plane. Along the plane's normal the distance is linear in t, so a step
// is one multiply-add, and several steps can go without a test between them.
#include "core/packet_group.h"
#include "core/shape_distances.h"
#include "march/march.h"
#include "march/march_single.h"
#include "march/plane_step.h"

enum { UNCHECKED_STEPS = 4 };

// Takes UNCHECKED_STEPS steps of all packets, and tests only then. The last t is the largest, so the least distance is
// held against the strictest hit test, and the bounds are convex. Returns false and changes nothing if a ray of these
// may have ended.
static bool step_unchecked(struct plane_ray line[GROUP], vfloat hit_distance) {
    vfloat t[GROUP], least[GROUP];
    for (int k = 0; k < GROUP; k++) {
        t[k] = line[k].t;
        least[k] = v_splat(INFINITY);
    }
    for (int i = 0; i < UNCHECKED_STEPS; i++)
        for (int k = 0; k < GROUP; k++) {
            vfloat distance = v_madd(t[k], line[k].direction, line[k].origin);
            least[k] = v_min(distance, least[k]);
            t[k] = t[k] + distance;
        }
    vmask ill = v_mask_none();
    for (int k = 0; k < GROUP; k++) {
        vmask on = v_cmp_lt_in(line[k].live, min_step(t[k], hit_distance), least[k]);
        on = v_cmp_lt_in(on, outside_of_bounds(line[k].exit, t[k]), v_splat(0.0f));
        ill = v_or(ill, v_andnot(on, line[k].live));
    }
    if (v_any(ill))
        return false;
    for (int k = 0; k < GROUP; k++)
        line[k].t = v_select(line[k].live, t[k], line[k].t);
    return true;
}

// The packets march abreast: the operations of each depend on each other, so the processor works on the others
// meanwhile.
void march_to_plane(struct march_state *packets, int shape, int next, struct packet_group *group,
                    const struct model *model) {
    vfloat hit_distance = v_splat((float)model->march.hit_distance);
    struct plane_ray line[GROUP];
    int cap = step_cap(model), left = cap, under_way = group->count, far = next;
    vmask outside = v_mask_none();
    for (int k = 0; k < GROUP; k++) {
        const struct local_ray *a = &group->packet[k].local[shape];
        line[k] = (struct plane_ray){a->origin.x, a->direction.x, group->t[k], packets[k].exit,
                                     group->live[k]};
        if (v_any(group->live[k]) && packets[k].left < left)
            left = packets[k].left;
        outside =
            v_or(outside, v_and(group->live[k], v_cmp_ge(line[k].exit.constant, v_splat(0.0f))));
    }
    // Unchecked steps could miss where a ray enters or leaves the bounds, if its origin is outside.
    if (v_any(outside))
        far = cap;
    for (int step = next; under_way > 0; step++) {
        while (step >= far && step + UNCHECKED_STEPS < left)
            if (step_unchecked(line, hit_distance))
                step += UNCHECKED_STEPS;
            else
                far = step + UNCHECKED_STEPS;
        struct step_result stride[GROUP];
        bool on = step < left;
        for (int k = 0; k < GROUP; k++)
            stride[k] = step_to_plane(&line[k], hit_distance);
        for (int k = 0; k < GROUP; k++)
            on = on && v_same(stride[k].inside, line[k].live);
        if (on)
            continue;
        for (int k = 0; k < GROUP; k++) {
            if (!v_any(line[k].live) ||
                (v_same(stride[k].inside, line[k].live) && step < packets[k].left))
                continue;
            group->distance[k] = stride[k].distance;
            end_rays(&packets[k], step, k, stride[k].going, stride[k].inside, group, cap);
            line[k].live = group->live[k];
            under_way -= !v_any(line[k].live);
        }
    }
    for (int i = 0; i < group->count; i++)
        packets[group->marching[i]].t = line[group->marching[i]].t;
}
