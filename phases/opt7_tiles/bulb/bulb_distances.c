// Distances of a Mandelbulb for a group of packets, packed: the rays that need one fill as few packets as they can.
#include "core/sdf.h"
#include "core/shape_distances.h"

#include "bulb/bulb_group.h"

// Evaluates a Mandelbulb for the rays in `asking` only. The other rays have ended, or another shape is surely nearer.
// An estimate costs ten times as much as the rest of a step. So the rays in `asking`, `rays` in number, are
// packed into as few packets as they fill, evaluated, and spread again.
static void pack_bulb_points(struct packet_group *group, int shape,
                             const struct primitive *primitive, const vmask asking[GROUP], int rays,
                             struct nearest_so_far *found) {
    float row[3][GROUP * LANES + LANES], distance[GROUP * LANES + LANES];
    int at = 0;
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        struct vec p = bulb_point(group, k, shape, primitive);
        vindex first = v_compress_index(asking[k]);
        v_permute_store(first, p.x, &row[0][at]);
        v_permute_store(first, p.y, &row[1][at]);
        v_permute_store(first, p.z, &row[2][at]);
        at += v_count(asking[k]);
        vfloat *wake = wake_of(&group->packet[k], shape);
        if (!primitive->repeated)
            *wake = v_select(asking[k], bulb_wake_bound(vec_dot(p, p), group->t[k]), *wake);
    }
    struct bulb_orbit bulb[GROUP];
    int count = 0;
    for (at = 0; at < rays; at += LANES, count++) {
        vmask some = v_mask_first(rays - at);
        bulb[count] = bulb_start(
            (struct vec){v_load(&row[0][at]), v_load(&row[1][at]), v_load(&row[2][at])}, some);
    }
    bulbs_iterate(bulb, count, primitive);
    for (int i = 0; i < count; i++)
        v_store(bulb_estimate(&bulb[i]), &distance[i * LANES]);
    at = 0;
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        store_bulb_distance(group, k, v_expand_load(asking[k], v_splat(INFINITY), &distance[at]),
                            found);
        at += v_count(asking[k]);
    }
}

// Evaluates a Mandelbulb for all packets, packed where that saves at least one packet.
void bulb_distances(struct packet_group *group, int shape, const struct primitive *primitive,
                    struct nearest_so_far *found) {
    vmask asking[GROUP];
    int rays = 0;
    for (int i = 0; i < group->count; i++) {
        int k = group->marching[i];
        asking[k] =
            v_and(group->live[k], v_cmp_nge(*wake_of(&group->packet[k], shape), found->limit[k]));
        rays += v_count(asking[k]);
    }
    if (rays <= (group->count - 1) * LANES)
        pack_bulb_points(group, shape, primitive, asking, rays, found);
    else
        whole_bulb_distances(group, shape, primitive, found);
}
