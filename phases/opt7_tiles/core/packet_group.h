// Packets of rays that march together, and where their rays are in the frame of each shape.
//
// In float, a point at |p| = 20 is known to 1e-6, which is the scene's hit distance. So nothing is evaluated in
// world coordinates. Each ray holds, for each shape, its origin and direction in that shape's own frame. The march
// evaluates origin + t·direction there, rounded once at the size of the shape.
#ifndef PACKET_GROUP_H
#define PACKET_GROUP_H

#include "core/shape_distances.h"
#include "simd/point.h"

// Packets of a group march together, one instruction of each after the other. The operations of a step depend on each
// other, so one packet alone would wait several times longer than it takes to issue them. The packets also share the
// choice of shapes: a shape that one of them needs is evaluated for all.
// GROUP is the most packets of a group. Where there is no Mandelbulb, SMALL_GROUP is enough: more packets would share
// longer lists of shapes.
enum { GROUP = 16, SMALL_GROUP = 4 };

// A packet of rays. `high` + t is an upper bound of the distance to the nearest steady shape.
struct packet_rays {
    struct local_ray *approach; // one per shape
    struct shape_list list; // shapes that its rays can meet: the same for all packets of a group
    // One per shape. A shape is not the nearest as long as its value exceeds t + the distance to the nearest shape.
    // The values of successive shapes are `apart` elements apart.
    vfloat *wake;
    int apart;
    vfloat high;
};

// Sets the rays' origins in the frame of each shape, and wakes every shape. approach_directions() comes next.
static inline void approach_origins(struct point origin, const struct prepared *scene,
                                    struct packet_rays *beam) {
    COUNT(approach_origins, call);
    struct local_ray *approach = beam->approach;
    beam->high = v_splat(INFINITY);
    struct vec_double at = vec_double_of(origin);
    for (int place = 0; place < beam->list.count; place++) {
        int i = beam->list.shape[place];
        const struct primitive *placed = &scene->placed[i];
        beam->wake[i * beam->apart] = v_splat(-INFINITY);
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
    for (int place = 0; place < beam->list.count; place++) {
        int i = beam->list.shape[place];
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
    for (int place = 0; place < beam->list.count; place++) {
        int i = beam->list.shape[place];
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
    for (int place = 0; place < beam->list.count; place++) {
        int i = beam->list.shape[place];
        struct local_ray *a = &beam->approach[i];
        COUNT(approach_moved, first);
        beam->wake[i * beam->apart] = beam->wake[i * beam->apart] - v_abs(by);
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

// Packets that march together.
struct packet_group {
    struct packet_rays beam[GROUP];
    vfloat t[GROUP], distance[GROUP]; // of the last step
    vfloat high[GROUP]; // that of its beam; −∞ where a ray is done, which wakes no shape
    vmask live[GROUP];
    int list[GROUP], count; // the packets that have a live ray
    int size;               // number of packets: SMALL_GROUP or GROUP
};

static inline void group_size(struct packet_group *group, int size) {
    group->size = size;
    for (int k = 0; k < size; k++)
        group->beam[k].apart = size;
}

#endif
