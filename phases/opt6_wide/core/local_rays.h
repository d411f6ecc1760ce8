// Where a packet's rays are in the frame of each shape.
//
// In float, a point at |p| = 20 is known to 1e-6, which is the scene's hit distance. So nothing is evaluated in
// world coordinates. Each ray holds, for each shape, its origin and direction in that shape's own frame. The march
// evaluates origin + t·direction there, rounded once at the size of the shape.
#pragma once

#include "core/packet_group.h"
#include "core/shape_distances.h"
#include "groups/region.h"

// Divides memory between the packets of a group: a wake and a local ray of each for each shape.
static inline void place_packets(struct packet_group *group, int packets, vfloat *wake,
                                 struct local_ray *local, int shapes) {
    for (int i = 0; i < shapes * packets; i++)
        wake[i] = v_splat(INFINITY); // a packet that never marched wakes no shape
    for (int k = 0; k < packets; k++)
        group->packet[k] = (struct packet_rays){.local = local + k * shapes, .wake = wake + k};
}

// Returns a packet that may meet all shapes, with rays in a worker's memory: core/tile.c.
struct packet_rays packet_in(void *scratch, const struct prepared *scene);

// Sets the rays' origins in the frame of each shape, and wakes every shape. set_local_directions() comes next.
static inline void set_local_origins(struct point origin, const struct prepared *scene,
                                     struct packet_rays *packet) {
    struct local_ray *local = packet->local;
    packet->high = v_splat(INFINITY);
    struct vec_double at = vec_double_of(origin);
    const struct shape_list *list = shapes_of(packet, scene);
    for (int n = 0; n < list->count; n++) {
        int i = list->shape[n];
        const struct primitive *primitive = &scene->primitives[i];
        *wake_of(packet, i) = v_splat(-INFINITY);
        if (primitive->eval == EVAL_POINT && !primitive->turned && !primitive->repeated) {
            local[i].origin = point_sub(origin, primitive->position, primitive->position_lo);
            continue;
        }
        struct vec_double from = vec_double_sub(at, primitive->centre);
        local[i].origin.x = coordinate(primitive, from, 0);
        if (primitive->eval == EVAL_LINEAR)
            continue;
        if (primitive->eval == EVAL_FIELD)
            forget_region(local[i].region);
        local[i].origin.y = coordinate(primitive, from, 1);
        local[i].origin.z = coordinate(primitive, from, 2);
        if (primitive->eval == EVAL_POWER)
            local[i].power = power_at(from, primitive->radius_sq);
    }
}

// Says that the origins, just set, are where the rays were at t.
static inline void recall_regions(vfloat t, const struct prepared *scene,
                                  const struct packet_rays *packet) {
    const struct shape_list *list = shapes_of(packet, scene);
    for (int n = 0; n < list->count; n++)
        if (scene->primitives[list->shape[n]].eval == EVAL_FIELD)
            recall_region(packet->local[list->shape[n]].region, t);
}

// Sets the rays' directions in the frame of each shape. Precondition: set_local_origins() has set the origins.
static inline void set_local_directions(struct vec direction, const struct prepared *scene,
                                        const struct packet_rays *packet) {
    struct local_ray *local = packet->local;
    const struct shape_list *list = shapes_of(packet, scene);
    for (int n = 0; n < list->count; n++) {
        int i = list->shape[n];
        const struct primitive *primitive = &scene->primitives[i];
        if (primitive->eval == EVAL_LINEAR) {
            local[i].direction.x = vec_dot(vec_set(primitive->normal), direction);
            continue;
        }
        if (primitive->eval == EVAL_FIELD)
            forget_region(local[i].region);
        local[i].direction = turned(primitive, direction);
        if (primitive->eval == EVAL_POWER)
            local[i].slope = v_splat(2.0f) * vec_dot(local[i].origin, local[i].direction);
    }
}

// Returns the distance to the nearest shape at distance t along the rays. `shape` becomes its number, of equal ones the
// first in the list.
static inline vfloat nearest_shape_at(const struct packet_rays *packet, vfloat t,
                                      const struct prepared *scene, vmask live, vfloat *shape) {
    vfloat least = v_splat(INFINITY);
    const struct shape_list *list = shapes_of(packet, scene);
    for (int n = 0; n < list->count; n++) {
        int i = list->shape[n];
        const struct primitive *primitive = &scene->primitives[i];
        vfloat distance = distance_to_shape(&packet->local[i], t, primitive, primitive->repeated,
                                            primitive->eval, primitive->type, live);
        *shape = v_select(v_cmp_lt(distance, least), v_splat(primitive->index), *shape);
        least = v_min(distance, least);
    }
    return least;
}

// Moves the origins along the rays by a small distance.
static inline void move_local_origins(vfloat by, const struct prepared *scene,
                                      struct packet_rays *packet) {
    packet->high = packet->high + v_abs(by);
    const struct shape_list *list = shapes_of(packet, scene);
    for (int n = 0; n < list->count; n++) {
        int i = list->shape[n];
        struct local_ray *a = &packet->local[i];
        *wake_of(packet, i) = *wake_of(packet, i) - v_abs(by);
        a->origin.x = v_madd(a->direction.x, by, a->origin.x);
        if (scene->primitives[i].eval == EVAL_LINEAR)
            continue;
        if (scene->primitives[i].eval == EVAL_FIELD && v_any(v_cmp_gt(v_abs(by), v_splat(0.0f))))
            forget_region(a->region);
        a->origin.y = v_madd(a->direction.y, by, a->origin.y);
        a->origin.z = v_madd(a->direction.z, by, a->origin.z);
        if (scene->primitives[i].eval == EVAL_POWER)
            a->power = v_madd(by, by + a->slope, a->power);
    }
}
