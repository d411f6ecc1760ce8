// Distances of a scene's shapes, for several packets of rays at once, and which shapes need not be asked.
//
// In float, a point at |p| = 20 is known to 1e-6, the scene's hit distance. So nothing is evaluated in world
// coordinates: each ray holds, for each shape, its origin and direction in that shape's own frame, and the
// march evaluates origin + t·direction there, rounded once at the size of the shape. Branches that differ
// between lanes are evaluated for all and selected by mask.
#ifndef SDF_H
#define SDF_H

#include "core/shape_distances.h"
#include "simd/permute.h"
#include "simd/point.h"

// Packets under way together, one instruction of each after the other: the chain of operations through a step
// is several times as long as it takes to issue them. They share the questions, too: a shape that one of
// them needs is evaluated for all.
enum {
    GROUP = 16,
    SMALL_GROUP = 4
}; // at most; SMALL_GROUP where no Mandelbulb is: more would have longer lists

// A packet of rays under way. `high` + t is no less than the distance to the nearest steady shape.
struct packet_rays {
    struct local_ray *approach; // one per shape
    struct shape_list list;     // those that its rays can meet: the same for all of a group
    // One per shape, so many apart: the shape is not the nearest as long as this is above (distance to the
    // nearest) + t.
    vfloat *wake;
    int apart;
    vfloat high;
};

// Fills one approach per shape: where the rays are, and then where they go.
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

// Distance to the nearest shape at distance t along the rays, and which one it is (the first of equals).
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

// The origins moved by a little along the rays.
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

struct packet_group {
    struct packet_rays beam[GROUP];
    vfloat t[GROUP], distance[GROUP]; // of the last step
    vfloat high[GROUP];               // of its beam; −∞ where a ray is done: it wakes no shape
    vmask live[GROUP];
    int list[GROUP], count; // of the packets that have a live ray
    int size;               // packets, SMALL_GROUP or GROUP
};

static inline void group_size(struct packet_group *group, int size) {
    group->size = size;
    for (int k = 0; k < size; k++)
        group->beam[k].apart = size;
}

// What scene_distances() has found so far of each packet. `limit`: distance + t of the nearest is no more.
struct nearest_so_far {
    vfloat least[GROUP], limit[GROUP];
};

// `steady`, `eval_kind` and `type` are known where these are inlined.
__attribute__((always_inline)) static inline void
packet_distance(struct packet_group *group, int k, int shape, int size,
                const struct primitive *placed, bool steady, enum eval_kind way,
                enum shape_type type, struct nearest_so_far *found) {
    ACTIVE(v_count(group->live[k]));
    COUNT(packet_distance, call);
    const struct local_ray *a = &group->beam[k].approach[shape];
    vfloat t = group->t[k];
    vfloat distance = distance_to_shape(a, t, placed, !steady, way, type, group->live[k]);
    vfloat sum = distance + t;
    found->least[k] = v_min(distance, found->least[k]);
    found->limit[k] = v_min(sum, found->limit[k]);
    if (steady) {
        COUNT(packet_distance, steady);
        group->beam[k].wake[shape * size] = wake_bound(sum, placed);
    }
}

__attribute__((always_inline)) static inline void
group_distances(struct packet_group *group, int shape, int size, const struct primitive *placed,
                bool steady, enum eval_kind way, enum shape_type type,
                struct nearest_so_far *found) {
    if (size == SMALL_GROUP && group->count == SMALL_GROUP) // unrolled
        for (int k = 0; k < SMALL_GROUP; k++)
            packet_distance(group, k, shape, size, placed, steady, way, type, found);
    else
        for (int i = 0; i < group->count; i++)
            packet_distance(group, group->list[i], shape, size, placed, steady, way, type, found);
}

// An iteration of each packet after the other: one alone is a chain of a hundred cycles, and too long for the
// processor to look beyond it to the next packet.
static inline void bulbs_iterate(struct bulb_orbit bulb[GROUP], int count,
                                 const struct primitive *placed) {
    for (int n = 0; n < placed->iterations; n++) {
        vmask inside = v_mask_none();
        for (int i = 0; i < count; i++) {
            bulb_iterate(&bulb[i], v_splat(placed->bailout));
            inside = v_or(inside, bulb[i].inside);
        }
        if (!v_any(inside))
            return;
    }
}

static inline struct vec bulb_point(const struct packet_group *group, int k, int shape,
                                    const struct primitive *placed) {
    COUNT(bulb_point, call);
    const struct local_ray *a = &group->beam[k].approach[shape];
    struct vec p = vec_along(a->origin, a->direction, group->t[k]);
    return placed->repeated ? vec_wrapped(placed, p) : p;
}

static inline void store_bulb_distance(const struct packet_group *group, int k, vfloat distance,
                                       struct nearest_so_far *found) {
    COUNT(store_bulb_distance, call);
    found->least[k] = v_min(distance, found->least[k]);
    found->limit[k] = v_min(distance + group->t[k], found->limit[k]);
}

// Rays that ask for it: the others have ended, or something else is nearer for sure. An estimate costs as much as all else
// of a step ten times over, so where those of all packets fill fewer, they move together for it.
static inline void pack_bulb_points(struct packet_group *group, int shape,
                                    const struct primitive *placed, const vmask asking[GROUP],
                                    int rays, struct nearest_so_far *found) {
    COUNT(pack_bulb_points, call);
    float row[3][GROUP * LANES + LANES], distance[GROUP * LANES + LANES];
    int at = 0;
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(v_count(asking[k]));
        struct vec p = bulb_point(group, k, shape, placed);
        vindex first = v_compress_index(asking[k]);
        v_permute_store(first, p.x, &row[0][at]);
        v_permute_store(first, p.y, &row[1][at]);
        v_permute_store(first, p.z, &row[2][at]);
        at += v_count(asking[k]);
        vfloat *wake = &group->beam[k].wake[shape * group->beam[k].apart];
        if (!placed->repeated) {
            COUNT(pack_bulb_points, steady);
            *wake = v_select(asking[k], bulb_wake_bound(vec_dot(p, p), group->t[k]), *wake);
        }
    }
    struct bulb_orbit bulb[GROUP];
    int count = 0;
    for (at = 0; at < rays; at += LANES, count++) {
        vmask some = v_mask_first(rays - at);
        ACTIVE(v_count(some));
        COUNT(pack_bulb_points, row);
        bulb[count] = bulb_start(
            (struct vec){v_load(&row[0][at]), v_load(&row[1][at]), v_load(&row[2][at])}, some);
    }
    bulbs_iterate(bulb, count, placed);
    for (int i = 0; i < count; i++) {
        ACTIVE(v_count(v_mask_first(rays - i * LANES)));
        v_store(bulb_estimate(&bulb[i]), &distance[i * LANES]);
    }
    at = 0;
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(v_count(asking[k]));
        store_bulb_distance(group, k, v_expand_load(asking[k], v_splat(INFINITY), &distance[at]),
                            found);
        at += v_count(asking[k]);
    }
}

static inline void bulb_distances(struct packet_group *group, int shape,
                                  const struct primitive *placed, struct nearest_so_far *found) {
    COUNT(bulb_distances, call);
    vmask asking[GROUP];
    int rays = 0;
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        asking[k] =
            v_and(group->live[k],
                  v_cmp_nge(group->beam[k].wake[shape * group->beam[k].apart], found->limit[k]));
        rays += v_count(asking[k]);
    }
    if (rays <= (group->count - 1) * LANES) {
        pack_bulb_points(group, shape, placed, asking, rays, found);
        return;
    }
    struct bulb_orbit bulb[GROUP];
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(v_count(group->live[k]));
        bulb[i] = bulb_start(bulb_point(group, k, shape, placed), group->live[k]);
        if (!placed->repeated)
            group->beam[k].wake[shape * group->beam[k].apart] =
                bulb_wake_bound(bulb[i].m, group->t[k]);
    }
    bulbs_iterate(bulb, group->count, placed);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(v_count(group->live[k]));
        store_bulb_distance(group, k, bulb_estimate(&bulb[i]), found);
    }
}

__attribute__((always_inline)) static inline bool all_asleep(const vfloat *wake, int size,
                                                             const struct nearest_so_far *found) {
    COUNT(all_asleep, call);
    vmask awake = v_cmp_nge(wake[0], found->limit[0]);
    for (int k = 1; k < size; k++) {
        COUNT(all_asleep, other);
        awake = v_or(awake, v_cmp_nge(wake[k], found->limit[k]));
    }
    return !v_any(awake);
}

// The types told apart once for all packets.
__attribute__((always_inline)) static inline void
distances_to_shape(struct packet_group *group, int shape, int size, const struct primitive *placed,
                   bool steady, struct nearest_so_far *found) {
#define EACH(way, type) group_distances(group, shape, size, placed, steady, way, type, found)
    if (steady && placed->way == EVAL_LINEAR) {
        EACH(EVAL_LINEAR, SHAPE_PLANE);
        return;
    }
    switch (placed->type) {
    case SHAPE_SPHERE:
        if (steady && placed->way == EVAL_POWER)
            EACH(EVAL_POWER, SHAPE_SPHERE);
        else
            EACH(EVAL_POINT, SHAPE_SPHERE);
        break;
    case SHAPE_BOX: EACH(EVAL_POINT, SHAPE_BOX); break;
    case SHAPE_TORUS: EACH(EVAL_POINT, SHAPE_TORUS); break;
    case SHAPE_CONE: EACH(EVAL_POINT, SHAPE_CONE); break;
    case SHAPE_OCTAHEDRON: EACH(EVAL_POINT, SHAPE_OCTAHEDRON); break;
    case SHAPE_ROUNDED_BOX: EACH(EVAL_POINT, SHAPE_ROUNDED_BOX); break;
    default: EACH(EVAL_POINT, SHAPE_PLANE); break;
    }
#undef EACH
}

// Steady shapes are no further than this in the next steps.
__attribute__((always_inline)) static inline void update_high(struct packet_group *group, int size,
                                                              const struct nearest_so_far *found) {
    COUNT(update_high, call);
    for (int k = 0; k < size; k++) {
        COUNT(update_high, packet);
        group->high[k] = v_min(found->least[k] - group->t[k], group->high[k]);
    }
}

// An evaluation of the scene's distance begins, of one packet. −∞ where no ray is left.
static inline void sdf(const struct packet_group *group, int k, struct nearest_so_far *found) {
    ACTIVE(v_count(group->live[k]));
    COUNT(sdf, call);
    found->least[k] = v_splat(INFINITY);
    found->limit[k] = v_madd(v_splat(2.0f), group->t[k], group->high[k]);
}

__attribute__((always_inline)) static inline void
reset_nearest(const struct packet_group *group, int size, struct nearest_so_far *found) {
    for (int k = 0; k < size; k++)
        sdf(group, k, found);
}

// The one shape that was asked in the last step, if it was one and steady, and how long all others sleep.
struct sole_shape {
    int shape; // −1: none, or more than one
    vfloat until[GROUP];
};

__attribute__((always_inline)) static inline void wake_of_others(const struct packet_group *group,
                                                                 int size,
                                                                 const struct shape_list *list,
                                                                 struct sole_shape *alone) {
    COUNT(wake_of_others, call);
    for (int k = 0; k < size; k++)
        alone->until[k] = v_splat(INFINITY);
    for (int n = 0; n < list->count; n++) {
        int i = list->order[n];
        if (i == alone->shape)
            continue;
        const vfloat *wake = &group->beam[0].wake[i * size];
        for (int k = 0; k < size; k++) { // no number: awake
            COUNT(wake_of_others, packet);
            alone->until[k] = v_min(v_max(wake[k], v_splat(-INFINITY)), alone->until[k]);
        }
    }
}

// All shapes that may be the nearest, but `sole_shape`, which has been asked.
__attribute__((always_inline)) static inline void
evaluate_awake(struct packet_group *group, int size, const struct prepared *scene,
               struct sole_shape *alone, struct nearest_so_far *found) {
    const struct shape_list *list = &group->beam[0].list;
    int asked = alone->shape, last = asked, count = asked >= 0;
    for (int n = 0; n < list->count; n++) {
        int i = list->order[n];
        if (n == list->steady)
            update_high(group, size, found);
        if (i == asked || all_asleep(&group->beam[0].wake[i * size], size, found))
            continue;
        count++;
        last = n < list->steady ? i : -1;
        const struct primitive *placed = &scene->placed[i];
        if (n < list->steady)
            distances_to_shape(group, i, size, placed, true, found);
        else if (placed->type == SHAPE_MANDELBULB)
            bulb_distances(group, i, placed, found);
        else
            distances_to_shape(group, i, size, placed, false, found);
    }
    if (list->steady == list->count)
        update_high(group, size, found);
    alone->shape = count == 1 ? last : -1;
    if (alone->shape >= 0)
        wake_of_others(group, size, list, alone);
}

// Distance to the nearest shape at distance t along the rays, t never less than the last time. A steady shape
// sleeps until it may be the nearest of some ray under way: what is left out is further than what is
// returned, so that not one bit depends on it, nor on which rays share a packet. Lanes that are not
// `live` may hold anything. (To remember how far the other shapes were: saethrej/sphere-tracing, a student
// project, keeps them in a priority queue.) Of most steps one shape is all that is awake, and the next step's
// too: it is asked first, and then all others at once. Whether `sole_shape` is formed anew.
__attribute__((always_inline)) static inline bool distances_of(struct packet_group *group, int size,
                                                               const struct prepared *scene,
                                                               struct sole_shape *alone) {
    struct nearest_so_far found;
    reset_nearest(group, size, &found);
    if (alone->shape >= 0)
        distances_to_shape(group, alone->shape, size, &scene->placed[alone->shape], true, &found);
    bool still = alone->shape >= 0 && all_asleep(alone->until, size, &found);
    if (still)
        update_high(group, size, &found);
    else
        evaluate_awake(group, size, scene, alone, &found);
    for (int k = 0; k < size; k++)
        group->distance[k] = found.least[k];
    return !still;
}

static inline bool scene_distances(struct packet_group *group, const struct prepared *scene,
                                   struct sole_shape *alone) {
    return group->size == SMALL_GROUP ? distances_of(group, SMALL_GROUP, scene, alone)
                                      : distances_of(group, GROUP, scene, alone);
}

// The packets that have a live ray, and what of a ray that has none would wake a shape.
static inline void start_packets(struct packet_group *group) {
    group->count = 0;
    for (int k = 0; k < group->size; k++) {
        group->high[k] = v_select(group->live[k], group->beam[k].high, v_splat(-INFINITY));
        if (v_any(group->live[k]))
            group->list[group->count++] = k;
        else
            group->t[k] = v_splat(0.0f);
    }
}

#endif
