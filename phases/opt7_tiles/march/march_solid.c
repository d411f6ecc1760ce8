// The march of rays that can hit nothing but one solid.
#include "core/packet_group.h"
#include "core/shape_distances.h"
#include "march/march.h"
#include "march/march_single.h"

// Marches all packets to the end. `type` is a constant.
__attribute__((always_inline)) static inline void march_one_solid(struct march_state packets[GROUP],
                                                                  int shape, enum shape_type type,
                                                                  struct packet_group *group,
                                                                  const struct prepared *scene) {
    const struct primitive *primitive = &scene->primitives[shape];
    vfloat hit_distance = v_splat((float)scene->model.march.hit_distance);
    int cap = step_cap(&scene->model), under_way = group->count;
    for (int step = 1; under_way > 0; step++)
        for (int i = 0; i < under_way;) {
            int k = group->marching[i];
            struct march_state *at = &packets[k];
            vmask live = group->live[k];
            ACTIVE(v_count(live));
            COUNT(solid_step, call);
            vfloat t = group->t[k];
            vfloat distance = distance_to_shape(&group->packet[k].local[shape], t, primitive, false,
                                                EVAL_POINT, type, live);
            vmask going = v_cmp_nlt_in(live, distance, min_step(t, hit_distance));
            group->t[k] = t = v_add_where(going, t, distance);
            vmask inside = v_cmp_ngt_in(going, outside_of_bounds(at->exit, t), v_splat(0.0f));
            i++;
            if (v_same(inside, live) && step < at->left)
                continue;
            group->distance[k] = distance;
            end_rays(at, step, k, going, inside, group, cap);
            if (v_any(group->live[k]))
                continue;
            at->t = t;
            group->marching[--i] = group->marching[--under_way];
        }
}

bool march_solid(struct march_state *packets, int shape, struct packet_group *group,
                 const struct prepared *scene) {
    const struct primitive *primitive = &scene->primitives[shape];
    if (!primitive->steady || primitive->eval != EVAL_POINT)
        return false;
    switch (primitive->type) {
    case SHAPE_SPHERE: march_one_solid(packets, shape, SHAPE_SPHERE, group, scene); return true;
    case SHAPE_BOX: march_one_solid(packets, shape, SHAPE_BOX, group, scene); return true;
    case SHAPE_TORUS: march_one_solid(packets, shape, SHAPE_TORUS, group, scene); return true;
    case SHAPE_CONE: march_one_solid(packets, shape, SHAPE_CONE, group, scene); return true;
    case SHAPE_OCTAHEDRON:
        march_one_solid(packets, shape, SHAPE_OCTAHEDRON, group, scene);
        return true;
    default: return false;
    }
}
