// Distances of a Mandelbulb for a group of packets. Included by bulb/bulb_distances.c, after core/sdf.h.
#pragma once

// Iterates the packets in turn. One iteration is a chain of a hundred cycles, too long for the processor to look beyond
// it to the next packet's.
static inline void bulbs_iterate(struct bulb_orbit bulb[GROUP], int count,
                                 const struct primitive *primitive) {
    for (int n = 0; n < primitive->iterations; n++) {
        vmask inside = v_mask_none();
        for (int i = 0; i < count; i++) {
            bulb_iterate(&bulb[i], v_splat(primitive->bailout));
            inside = v_or(inside, bulb[i].inside);
        }
        if (!v_any(inside))
            return;
    }
}

// Returns where the rays of packet k are, in the Mandelbulb's frame.
static inline struct vec bulb_point(const struct packet_group *group, int k, int shape,
                                    const struct primitive *primitive) {
    const struct local_ray *a = &group->packet[k].local[shape];
    struct vec p = vec_along(a->origin, a->direction, group->t[k]);
    return primitive->repeated ? vec_wrapped(primitive, p) : p;
}

// Merges a Mandelbulb's distance into what is found for packet k.
static inline void store_bulb_distance(const struct packet_group *group, int k, vfloat distance,
                                       struct nearest_so_far *found) {
    found->least[k] = v_min(distance, found->least[k]);
    found->limit[k] = v_min(distance + group->t[k], found->limit[k]);
}

// Evaluates a Mandelbulb for all packets.
static inline void whole_bulb_distances(struct packet_group *group, int shape,
                                        const struct primitive *primitive,
                                        struct nearest_so_far *found) {
    struct bulb_orbit bulb[GROUP];
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        bulb[i] = bulb_start(bulb_point(group, k, shape, primitive), group->live[k]);
        if (!primitive->repeated)
            *wake_of(&group->packet[k], shape) = bulb_wake_bound(bulb[i].m, group->t[k]);
    }
    bulbs_iterate(bulb, group->count, primitive);
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        store_bulb_distance(group, k, bulb_estimate(&bulb[i]), found);
    }
}
