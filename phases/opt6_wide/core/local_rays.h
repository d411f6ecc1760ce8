// Where a packet's rays are in the frame of each shape.
//
// In float, a point at |p| = 20 is known to 1e-6, which is the scene's hit distance. So nothing is evaluated in
// world coordinates. Each ray holds, for each shape, its origin and direction in that shape's own frame. The march
// evaluates origin + t·direction there, rounded once at the size of the shape.
#ifndef LOCAL_RAYS_H
#define LOCAL_RAYS_H

#include "core/packet_group.h"
#include "core/shape_distances.h"

// Sets the rays' origins in the frame of each shape, and wakes every shape. approach_directions() comes next.
static inline void approach_origins(struct point origin, const struct prepared *scene,
                                    struct packet_rays *beam) {
    COUNT(approach_origins, call);
    struct local_ray *approach = beam->approach;
    beam->high = v_splat(INFINITY);
    struct vec_double at = vec_double_of(origin);
    const struct shape_list *list = shapes_of(beam, scene);
    for (int n = 0; n < list->count; n++) {
        int i = list->shape[n];
        const struct primitive *placed = &scene->placed[i];
        *wake_of(beam, i) = v_splat(-INFINITY);
        if (placed->way == EVAL_POINT && !placed->turned && !placed->repeated) {
            approach[i].origin = point_sub(origin, placed->position, placed->position_lo);
            continue;
        }
        struct vec_double from = vec_double_sub(at, placed->centre);
        approach[i].origin.x = coordinate(placed, from, 0);
        if (placed->way == EVAL_LINEAR)
            continue;
        approach[i].origin.y = coordinate(placed, from, 1);
        approach[i].origin.z = coordinate(placed, from, 2);
        if (placed->way == EVAL_POWER)
            approach[i].power = power_at(from, placed->radius_sq);
    }
}

// Sets the rays' directions in the frame of each shape. Precondition: approach_origins() has set the origins.
static inline void approach_directions(struct vec direction, const struct prepared *scene,
                                       const struct packet_rays *beam) {
    COUNT(approach_directions, call);
    struct local_ray *approach = beam->approach;
    const struct shape_list *list = shapes_of(beam, scene);
    for (int n = 0; n < list->count; n++) {
        int i = list->shape[n];
        const struct primitive *placed = &scene->placed[i];
        if (placed->way == EVAL_LINEAR) {
            COUNT(approach_directions, linear);
            approach[i].direction.x = vec_dot(vec_set(placed->normal), direction);
            continue;
        }
        approach[i].direction = turned(placed, direction);
        if (placed->way == EVAL_POWER) {
            COUNT(approach_directions, power);
            approach[i].slope = v_splat(2.0f) * vec_dot(approach[i].origin, approach[i].direction);
        }
    }
}

// Returns the distance to the nearest shape at distance t along the rays. `shape` becomes its number, of equal ones the
// first in the list.
static inline vfloat nearest_shape_at(const struct packet_rays *beam, vfloat t,
                                      const struct prepared *scene, vmask live, vfloat *shape) {
    COUNT(nearest_shape_at, call);
    vfloat least = v_splat(INFINITY);
    const struct shape_list *list = shapes_of(beam, scene);
    for (int n = 0; n < list->count; n++) {
        int i = list->shape[n];
        COUNT(nearest_shape_at, shape);
        const struct primitive *placed = &scene->placed[i];
        vfloat distance = distance_to_shape(&beam->approach[i], t, placed, placed->repeated,
                                            placed->way, placed->type, live);
        *shape = v_select(v_cmp_lt(distance, least), v_splat(placed->index), *shape);
        least = v_min(distance, least);
    }
    return least;
}

// Moves the origins along the rays by a small distance.
static inline void approach_moved(vfloat by, const struct prepared *scene,
                                  struct packet_rays *beam) {
    COUNT(approach_moved, call);
    beam->high = beam->high + v_abs(by);
    const struct shape_list *list = shapes_of(beam, scene);
    for (int n = 0; n < list->count; n++) {
        int i = list->shape[n];
        struct local_ray *a = &beam->approach[i];
        COUNT(approach_moved, first);
        *wake_of(beam, i) = *wake_of(beam, i) - v_abs(by);
        a->origin.x = v_madd(a->direction.x, by, a->origin.x);
        if (scene->placed[i].way == EVAL_LINEAR)
            continue;
        COUNT(approach_moved, others);
        a->origin.y = v_madd(a->direction.y, by, a->origin.y);
        a->origin.z = v_madd(a->direction.z, by, a->origin.z);
        if (scene->placed[i].way == EVAL_POWER) {
            COUNT(approach_moved, power);
            a->power = v_madd(by, by + a->slope, a->power);
        }
    }
}

#endif
