// Distances of a scene's shapes, for a group of packets at once, and which shapes need not be evaluated. Branches that
// differ between lanes are evaluated for all lanes and selected by mask.
#pragma once

#include "core/packet_group.h"
#include "core/shape_distances.h"

enum { UNROLLED = (int)GROUP < 4 ? (int)GROUP : 4 }; // loops over so many packets are unrolled

// What scene_distances() has found so far, of each packet. `least` is the least distance. `limit` is an upper bound of
// t + the distance to the nearest shape.
struct nearest_so_far {
    vfloat least[GROUP], limit[GROUP];
};

// Whether no live ray can have this shape as its nearest.
__attribute__((always_inline)) static inline bool all_asleep(const vfloat *wake, int size,
                                                             const struct nearest_so_far *found) {
    vmask awake = v_cmp_nge(wake[0], found->limit[0]);
    for (int k = 1; k < size; k++)
        awake = v_or(awake, v_cmp_nge(wake[k], found->limit[k]));
    return !v_any(awake);
}

// Lowers `high` once all steady shapes are evaluated. In later steps `high` + t is an upper bound of the distance to the
// nearest of them.
__attribute__((always_inline)) static inline void update_high(struct packet_group *group, int size,
                                                              const struct nearest_so_far *found) {
    for (int k = 0; k < size; k++)
        group->high[k] = v_min(found->least[k] - group->t[k], group->high[k]);
}

// Evaluates one shape for packet k. `steady`, `kind` and `type` are constants where this is inlined.
__attribute__((always_inline)) static inline void
packet_distance(struct packet_group *group, int k, int shape, int size,
                const struct primitive *primitive, bool steady, enum eval_kind kind,
                enum shape_type type, struct nearest_so_far *found) {
    ACTIVE(v_count(group->live[k]));
    if (kind != EVAL_LINEAR) // a plane's product is counted as no evaluation
        COUNT(packet_distance, call);
    const struct local_ray *a = &group->packet[k].local[shape];
    vfloat t = group->t[k];
    vfloat distance = distance_to_shape(a, t, primitive, !steady, kind, type, group->live[k]);
    vfloat sum = distance + t;
    found->least[k] = v_min(distance, found->least[k]);
    found->limit[k] = v_min(sum, found->limit[k]);
    if (steady)
        group->packet[k].wake[shape * size] = wake_bound(sum, primitive);
}

__attribute__((always_inline)) static inline void
group_distances(struct packet_group *group, int shape, int size, const struct primitive *primitive,
                bool steady, enum eval_kind kind, enum shape_type type,
                struct nearest_so_far *found) {
    if (size == UNROLLED && group->count == UNROLLED)
        for (int k = 0; k < UNROLLED; k++)
            packet_distance(group, k, shape, size, primitive, steady, kind, type, found);
    else
        for (int i = 0; i < group->count; i++)
            packet_distance(group, group->marching[i], shape, size, primitive, steady, kind, type,
                            found);
}

// Evaluates a Mandelbox, which never sleeps, for all packets.
__attribute__((noinline, unused)) static void box_distances(struct packet_group *group, int shape,
                                                            const struct primitive *s,
                                                            struct nearest_so_far *found) {
    struct vec p[GROUP];
    vfloat to[GROUP];
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        ACTIVE(v_count(group->live[k]));
        COUNT(packet_distance, call);
        p[i] = point_on(&group->packet[k].local[shape], group->t[k], s);
    }
    sdf_mandelboxes(p, group->count, s, to);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        found->least[k] = v_min(to[i], found->least[k]);
        found->limit[k] = v_min(to[i] + group->t[k], found->limit[k]);
    }
}

// Evaluates a Mandelbulb for all packets: bulb/bulb_distances.c.
void bulb_distances(struct packet_group *group, int shape, const struct primitive *primitive,
                    struct nearest_so_far *found);

// Evaluates a group for all packets: groups/packets.c.
void field_distances(struct packet_group *group, int shape, const struct primitive *primitive,
                     struct nearest_so_far *found);

// Evaluates one shape for all packets: its type is switched on once for all of them.
__attribute__((always_inline)) static inline void
distances_to_shape(struct packet_group *group, int shape, int size,
                   const struct primitive *primitive, bool steady, struct nearest_so_far *found) {
    if (steady && primitive->eval == EVAL_LINEAR) {
        group_distances(group, shape, size, primitive, steady, EVAL_LINEAR, SHAPE_PLANE, found);
        return;
    }
    switch (primitive->type) {
    case SHAPE_SPHERE:
        if (steady && primitive->eval == EVAL_POWER)
            group_distances(group, shape, size, primitive, steady, EVAL_POWER, SHAPE_SPHERE, found);
        else
            group_distances(group, shape, size, primitive, steady, EVAL_POINT, SHAPE_SPHERE, found);
        break;
    case SHAPE_BOX:
        group_distances(group, shape, size, primitive, steady, EVAL_POINT, SHAPE_BOX, found);
        break;
    case SHAPE_TORUS:
        group_distances(group, shape, size, primitive, steady, EVAL_POINT, SHAPE_TORUS, found);
        break;
    case SHAPE_CONE:
        group_distances(group, shape, size, primitive, steady, EVAL_POINT, SHAPE_CONE, found);
        break;
    case SHAPE_OCTAHEDRON:
        group_distances(group, shape, size, primitive, steady, EVAL_POINT, SHAPE_OCTAHEDRON, found);
        break;
    case SHAPE_ROUNDED_BOX:
        group_distances(group, shape, size, primitive, steady, EVAL_POINT, SHAPE_ROUNDED_BOX,
                        found);
        break;
    case SHAPE_GROUP: field_distances(group, shape, primitive, found); break;
    case SHAPE_MANDELBOX: box_distances(group, shape, primitive, found); break;
    default:
        group_distances(group, shape, size, primitive, steady, EVAL_POINT, SHAPE_PLANE, found);
        break;
    }
}

// Begins an evaluation of the scene's distance. The limit is −∞ where a ray is done.
__attribute__((always_inline)) static inline void
reset_nearest(const struct packet_group *group, int size, struct nearest_so_far *found) {
    for (int k = 0; k < size; k++) {
        found->least[k] = v_splat(INFINITY);
        found->limit[k] = v_madd(v_splat(2.0f), group->t[k], group->high[k]);
    }
}

// The shape that was evaluated in the last step, if it was the only one and steady. Until distance + t reaches `until`,
// no other shape can be nearer.
struct sole_shape {
    int shape; // −1: none, or more than one
    vfloat until[GROUP];
};

__attribute__((always_inline)) static inline void wake_of_others(const struct packet_group *group,
                                                                 int size,
                                                                 const struct shape_list *list,
                                                                 struct sole_shape *sole) {
    for (int k = 0; k < size; k++)
        sole->until[k] = v_splat(INFINITY);
    for (int n = 0; n < list->count; n++) {
        int i = list->order[n];
        if (i == sole->shape)
            continue;
        const vfloat *wake = &group->packet[0].wake[i * size];
        for (int k = 0; k < size; k++) // NaN becomes −∞: awake
            sole->until[k] = v_min(v_max(wake[k], v_splat(-INFINITY)), sole->until[k]);
    }
}

// Evaluates all shapes that may be the nearest, except `sole_shape`, which the caller has evaluated.
static inline void evaluate_awake(struct packet_group *group, int size,
                                  const struct prepared *scene, struct sole_shape *sole,
                                  struct nearest_so_far *found) {
    const struct shape_list *list = shapes_of(&group->packet[0], scene);
    int first = sole->shape, last = first, count = first >= 0;
    for (int n = 0; n < list->count; n++) {
        int i = list->order[n];
        if (n == list->steady)
            update_high(group, size, found);
        if (i == first || all_asleep(&group->packet[0].wake[i * size], size, found))
            continue;
        count++;
        last = n < list->steady ? i : -1;
        const struct primitive *primitive = &scene->primitives[i];
        if (n < list->steady)
            distances_to_shape(group, i, size, primitive, true, found);
        else if (primitive->type == SHAPE_MANDELBULB)
            bulb_distances(group, i, primitive, found);
        else
            distances_to_shape(group, i, size, primitive, false, found);
    }
    if (list->steady == list->count)
        update_high(group, size, found);
    sole->shape = count == 1 ? last : -1;
    if (sole->shape >= 0)
        wake_of_others(group, size, list, sole);
}

// Finds each packet's distance to the nearest shape at t along the rays. Precondition: t never decreases.
// A steady shape sleeps until it may be the nearest shape of some live ray. A sleeping shape is further than the
// result, so no bit of the result depends on sleep or on which rays share a packet. Lanes that are not `live` may hold
// anything. In most steps one shape is awake, the same as in the step before. It is evaluated first, and one test says
// whether all others still sleep. Returns whether `sole_shape` was formed anew.
// Remembered distances: saethrej/sphere-tracing, a student project, keeps them in a priority queue.
__attribute__((always_inline)) static inline bool distances_of(struct packet_group *group, int size,
                                                               const struct prepared *scene,
                                                               struct sole_shape *sole) {
    struct nearest_so_far found;
    reset_nearest(group, size, &found);
    if (sole->shape >= 0)
        distances_to_shape(group, sole->shape, size, &scene->primitives[sole->shape], true, &found);
    bool still = sole->shape >= 0 && all_asleep(sole->until, size, &found);
    if (still)
        update_high(group, size, &found);
    else
        evaluate_awake(group, size, scene, sole, &found);
    for (int k = 0; k < size; k++)
        group->distance[k] = found.least[k];
    return !still;
}

// Groups of either size, out of line: a march that holds both copies is slower (opt7_tiles, scene0: 1.08).
__attribute__((noinline, unused)) static bool distances_of_either(struct packet_group *group,
                                                                  const struct prepared *scene,
                                                                  struct sole_shape *sole) {
    return packets_in(group) == UNROLLED ? distances_of(group, UNROLLED, scene, sole)
                                         : distances_of(group, GROUP, scene, sole);
}

__attribute__((always_inline)) static inline bool
scene_distances(struct packet_group *group, const struct prepared *scene, struct sole_shape *sole) {
    if (UNROLLED < (int)GROUP)
        return distances_of_either(group, scene, sole);
    return packets_in(group) == UNROLLED ? distances_of(group, UNROLLED, scene, sole)
                                         : distances_of(group, GROUP, scene, sole);
}

// Lists the packets that have a live ray. A ray that is done gets high = −∞, so that it wakes no shape.
static inline void start_packets(struct packet_group *group) {
    group->count = 0;
    for (int k = 0; k < packets_in(group); k++) {
        group->high[k] = v_select(group->live[k], group->packet[k].high, v_splat(-INFINITY));
        if (v_any(group->live[k]))
            group->marching[group->count++] = k;
        else
            group->t[k] = v_splat(0.0f);
    }
}
