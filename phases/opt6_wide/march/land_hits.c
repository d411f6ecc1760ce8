// Places hits on their surface.
#include "core/local_rays.h"
#include "march/march.h"

// Finds the shape that a ray of `deep` was in when its march ended. It is found here because the step back may bring
// the ray nearer to another shape.
__attribute__((noinline)) static void shape_inside(vmask deep, vfloat t,
                                                   const struct prepared *scene,
                                                   const struct packet_rays *packet,
                                                   vfloat *shape) {
    vfloat inside = v_splat(-1.0f);
    nearest_shape_at(packet, t, scene, deep, &inside);
    *shape = v_select(deep, inside, *shape);
}

bool land_hits(struct march_state *at, vmask settled, struct vec direction,
               const struct prepared *scene, struct packet_rays *packet, vmask *live) {
    if (!v_any(at->found))
        return false;
    float twice = 2.0f * (float)scene->model.march.hit_distance;
    vmask sunk = v_and(v_andnot(settled, at->found), v_cmp_lt(at->last, v_splat(-twice)));
    if (v_any(sunk))
        shape_inside(sunk, at->t, scene, packet, &at->inside);
    at->deep = v_or(at->deep, sunk);
    // A settled hit keeps every bit, whatever its neighbours in the packet do.
    at->origin =
        point_select(settled, at->origin, point_at(at->origin, direction, at->t, at->last));
    set_local_origins(at->origin, scene, packet);
    if (scene->groups && !v_any(settled))
        recall_regions(at->t + at->last, scene, packet);
    at->near = near_hit(at->found, scene, packet);
    vmask off = v_and(may_be_off(at, settled), v_cmp_gt(at->near.distance, v_splat(twice)));
    if (!v_any(off))
        return false;
    // The ray restarts a few ulps of t earlier, surely before the surface, however thin the shape is.
    vfloat back = v_select_or_zero(off, at->t * v_splat(-0x1p-22f));
    at->origin.lo = vec_along(at->origin.lo, direction, back);
    at->before = v_select(off, at->before + (at->t + (at->last + back)), at->before);
    set_local_origins(at->origin, scene, packet);
    set_local_directions(direction, scene, packet);
    at->found = v_andnot(off, at->found);
    *live = v_cmp_lt_in(off, at->evals, v_splat((float)at->cap));
    return v_any(*live);
}

struct hit finish_hit(struct march_state *at, struct vec direction, const struct prepared *scene,
                      struct packet_rays *packet, struct hit_normal *at_hit) {
    struct hit hit = {.found = at->found, .shape = v_splat(-1.0f), .evals = at->evals};
    if (!v_any(at->found))
        return hit;
    vfloat path = at->before + at->t;
    vmask unmoved = v_cmp_ge(v_splat(0.0f), path); // starts at or in a shape, and hits it there
    hit.found = v_and(hit.found, v_or(within(at->origin, &scene->model), unmoved));
    struct hit_surroundings near = at->near;
    if (v_any(at->deep)) {
        vmask other = v_cmp_ge(v_abs(near.shape - at->inside), v_splat(0.5f));
        near.contact = v_or(near.contact, v_and(at->deep, other));
        near.shape = v_select(at->deep, at->inside, near.shape);
    }
    *at_hit = normal_at(direction, hit.found, &near, scene, packet);
    hit.normal = at_hit->normal;
    hit.shape = v_select(hit.found, near.shape, hit.shape);
    vfloat more = v_zero_where(at->deep, newton(near.distance, at_hit->slope, path));
    hit.t = at->before + (at->t + (at->last + more));
    hit.point = at->origin;
    hit.point.lo = vec_along(hit.point.lo, direction, more);
    move_local_origins(more, scene, packet);
    return hit;
}
