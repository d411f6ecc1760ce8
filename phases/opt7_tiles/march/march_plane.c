// The march of rays that can hit nothing but a plane. Along the plane's normal the distance is linear in t, so a step
// is one multiply-add.
#include "core/packet_group.h"
#include "core/sdf.h"
#include "core/shape_distances.h"
#include "march/march_single.h"
#include "march/march_state.h"

// A packet of rays, by their distance from the plane: `origin` at t = 0, and `direction` per unit of t.
struct plane_ray {
    vfloat origin, direction, t;
    struct bounds_exit exit;
    vmask live;
};

// The outcome of a step.
struct step_result {
    vfloat distance;
    vmask going, inside;
};

static inline struct step_result step_to_plane(struct plane_ray *line, vfloat hit_distance) {
    ACTIVE(v_count(line->live));
    COUNT(step_to_plane, call);
    vfloat distance = v_madd(line->t, line->direction, line->origin);
    vmask going = v_cmp_nlt_in(line->live, distance, min_step(line->t, hit_distance));
    line->t = v_add_where(going, line->t, distance);
    vmask inside = v_cmp_ngt_in(going, outside_of_bounds(line->exit, line->t), v_splat(0.0f));
    return (struct step_result){distance, going, inside};
}

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

// Up to the plane, distance + t is at most the ray's t on the plane, origin/−direction. That quotient is taken 2^-16
// too large, 256 times the rounding errors of the quotient and of the steps.
bool plane_is_sole_hit(const struct packet_group *group, const struct sole_shape *sole) {
    bool falls = true;
    for (int i = 0; i < group->count && falls; i++) {
        int k = group->marching[i];
        const struct local_ray *a = &group->packet[k].local[sole->shape];
        vfloat down = v_splat(0.0f) - a->direction.x;
        vmask on = v_cmp_lt_in(group->live[k], v_splat(0.0f), down);
        on = v_cmp_lt_in(on, a->origin.x / down * v_splat(1.0f + 0x1p-16f), sole->until[k]);
        falls = v_same(on, group->live[k]);
    }
    return falls;
}
