// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). A packet marches until its last ray is done.
#include "core/numerics.h"
#include "core/ray_queues.h"
#include "march/march_state.h"
#include "march/march_step.h"
#include "simd/point.h"

// Returns how many steps every live ray still has before the cap. Rays that march on from a hit have used some.
static int steps_left(const struct march_state *at, vmask live, int cap) {
    COUNT(steps_left, call);
    return cap + (int)v_reduce_min(v_select_or_zero(live, v_splat(0.0f) - at->evals));
}

// Not inlined: it runs once per ray, the steps around it many times.
__attribute__((noinline)) void end_rays(struct march_state *at, int step, int k, vmask going,
                                        vmask inside, struct packet_group *group, int cap) {
    COUNT(end_rays, call);
    vmask live = group->live[k], reached = v_andnot(going, live);
    at->last = v_select(reached, group->distance[k], at->last);
    at->found = v_or(at->found, reached);
    vfloat evals = at->evals + v_splat((float)step);
    if (step >= at->left) {
        COUNT(end_rays, cap);
        inside = v_cmp_lt_in(inside, evals, v_splat((float)cap));
    }
    at->evals = v_select(v_andnot(inside, live), evals, at->evals);
    group->live[k] = inside;
    group->high[k] = v_select(inside, group->high[k], v_splat(-INFINITY));
}

void start_packets(struct packet_group *group) {
    group->count = 0;
    for (int k = 0; k < GROUP; k++) {
        group->high[k] = v_select(group->live[k], group->beam[k].high, v_splat(-INFINITY));
        if (v_any(group->live[k]))
            group->list[group->count++] = k;
        else
            group->t[k] = v_splat(0.0f);
    }
}

// Takes a packet's step number `step`, with its distance known. Returns false if no ray of the packet is left.
static inline bool march_step(struct march_state *at, int step, int k, struct packet_group *group,
                              const struct model *model) {
    vmask live = group->live[k];
    ACTIVE(v_count(live));
    COUNT(march_step, call);
    vfloat t = group->t[k], distance = group->distance[k];
    vmask going =
        v_cmp_nlt_in(live, distance, min_step(t, v_splat((float)model->march.hit_distance)));
    group->t[k] = t = v_add_where(going, t, distance);
    vmask inside = v_cmp_ngt_in(going, outside_of_bounds(at->exit, t), v_splat(0.0f));
    if (v_same(inside, live) && step < at->left)
        return true;
    end_rays(at, step, k, going, inside, group, step_cap(model));
    return v_any(group->live[k]);
}

// Marches all packets to the end where the solid `shape` is the only shape that the rays can hit. No shape sleeps or
// wakes, and `type` is a constant.
__attribute__((always_inline)) static inline void march_one_solid(struct march_state packets[GROUP],
                                                                  int shape, enum shape_type type,
                                                                  struct packet_group *group,
                                                                  const struct prepared *scene) {
    COUNT(march_one_solid, call);
    const struct primitive *placed = &scene->placed[shape];
    vfloat hit_distance = v_splat((float)scene->model.march.hit_distance);
    int cap = step_cap(&scene->model), under_way = group->count;
    for (int step = 1; under_way > 0; step++)
        for (int i = 0; i < under_way;) {
            int k = group->list[i];
            struct march_state *at = &packets[k];
            vmask live = group->live[k];
            ACTIVE(v_count(live));
            COUNT(march_one_solid, step);
            vfloat t = group->t[k];
            vfloat distance = distance_to_shape(&group->beam[k].approach[shape], t, placed, false,
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
            group->list[--i] = group->list[--under_way];
        }
}

// Calls march_one_solid() for the solid's type. Returns false, with nothing done, if there is no version for it.
static bool march_solid(struct march_state packets[GROUP], int shape, struct packet_group *group,
                        const struct prepared *scene) {
    const struct primitive *placed = &scene->placed[shape];
    if (!placed->steady || placed->way != EVAL_POINT)
        return false;
    switch (placed->type) {
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

// Marches all packets until every ray has ended. The hit test is min_step()'s, which widens with t as a float's error does.
static void march(struct march_state packets[GROUP], const struct ray_group *rays,
                  struct trace_context *world) {
    COUNT(march, call);
    const struct prepared *scene = world->scene;
    struct packet_group *group = &world->group;
    start_packets(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(v_count(group->live[k]));
        struct march_state *at = &packets[k];
        at->exit = bounds_exit_of(at->origin, rays->direction[k], &scene->model);
        at->left = steps_left(at, group->live[k], step_cap(&scene->model));
        group->t[k] = v_select(group->live[k], at->start, at->t); // rays that are done stay
        at->start = v_splat(0.0f);
        at->last = v_zero_where(group->live[k], at->last);
    }
    struct shape_list list = group->beam[0].list;
    if (list.count == 1 && scene->placed[*list.shape].way == EVAL_LINEAR) {
        march_to_plane(packets, *list.shape, 1, group, &scene->model);
        return;
    }
    if (list.count == 1 && march_solid(packets, *list.shape, group, scene))
        return;
    struct sole_shape alone = {.shape = -1};
    for (int step = 1; group->count > 0; step++) {
        bool anew = scene_distances(group, scene, &alone);
        for (int i = 0; i < group->count;) {
            int k = group->list[i];
            if (march_step(&packets[k], step, k, group, &scene->model)) {
                i++;
                continue;
            }
            packets[k].t = group->t[k];
            group->list[i] = group->list[--group->count];
        }
        if (anew && alone.shape >= 0 && scene->placed[alone.shape].way == EVAL_LINEAR &&
            plane_is_sole_hit(group, &alone)) {
            march_to_plane(packets, alone.shape, step + 1, group, &scene->model);
            return;
        }
    }
}

// Finds the shape that a ray of `deep` was in when its march ended. It is found here because the step back may bring the
// ray nearer to another shape.
__attribute__((noinline)) static void shape_inside(vmask deep, vfloat t,
                                                   const struct prepared *scene,
                                                   const struct packet_rays *beam, vfloat *shape) {
    ACTIVE(v_count(deep));
    COUNT(shape_inside, call);
    vfloat inside = v_splat(-1.0f);
    nearest_shape_at(beam, t, scene, deep, &inside);
    *shape = v_select(deep, inside, *shape);
}

// Makes each hit the origin of its ray, in the frames of all shapes. There a distance is rounded at the size of a
// shape, not of the path to it. A hit may still be further than twice the hit distance from any shape: the march has
// rounding errors, and its test may be wider than the scene's. Such a ray marches on. Returns whether there is one.
// Hits in `settled` were landed by an earlier call.
static bool land_hits(struct march_state *at, vmask settled, struct vec direction,
                      const struct prepared *scene, struct packet_rays *beam, vmask *live) {
    ACTIVE(v_count(at->found));
    COUNT(land_hits, call);
    if (!v_any(at->found))
        return false;
    COUNT(land_hits, point);
    COUNT(land_hits, scalar);
    float twice = 2.0f * (float)scene->model.march.hit_distance;
    vmask sunk = v_and(v_andnot(settled, at->found), v_cmp_lt(at->last, v_splat(-twice)));
    if (v_any(sunk))
        shape_inside(sunk, at->t, scene, beam, &at->inside);
    at->deep = v_or(at->deep, sunk);
    // A settled hit keeps every bit, whatever its neighbours in the packet do.
    at->origin =
        point_select(settled, at->origin, point_at(at->origin, direction, at->t, at->last));
    approach_origins(at->origin, scene, beam);
    at->near = near_hit(at->found, scene, beam);
    vmask asked = v_andnot(v_or(at->told, v_or(at->deep, settled)), at->found);
    vmask off = v_and(asked, v_cmp_gt(at->near.distance, v_splat(twice)));
    if (!v_any(off))
        return false;
    ACTIVE(v_count(off));
    COUNT(land_hits, on);
    // The ray restarts a few ulps of t earlier, surely before the surface, however thin the shape is.
    vfloat back = v_select_or_zero(off, at->t * v_splat(-0x1p-22f));
    at->origin.lo = vec_along(at->origin.lo, direction, back);
    at->before = v_select(off, at->before + (at->t + (at->last + back)), at->before);
    approach_origins(at->origin, scene, beam);
    approach_directions(direction, scene, beam);
    at->found = v_andnot(off, at->found);
    *live = v_cmp_lt_in(off, at->evals, v_splat((float)step_cap(&scene->model)));
    return v_any(*live);
}

// Returns the hits once all have landed: distance, place, normal and shape, after Newton's last step.
static struct hit finish_hit(struct march_state *at, struct vec direction,
                             const struct prepared *scene, struct packet_rays *beam) {
    COUNT(finish_hit, call);
    struct hit hit = {.found = at->found, .shape = v_splat(-1.0f), .evals = at->evals};
    hit.smooth = v_mask_none();
    if (!v_any(at->found))
        return hit;
    vfloat way = at->before + at->t;
    // A ray that has not moved starts at or in a shape. It hits it there, even outside of the bounds.
    vmask unmoved = v_cmp_ge(v_splat(0.0f), way);
    hit.found = v_and(hit.found, v_or(within(at->origin, &scene->model), unmoved));
    struct hit_surroundings near = at->near;
    if (v_any(at->deep)) {
        COUNT(finish_hit, deep);
        vmask other = v_cmp_ge(v_abs(near.shape - at->inside), v_splat(0.5f));
        near.contact = v_or(near.contact, v_and(at->deep, other));
        near.shape = v_select(at->deep, at->inside, near.shape);
    }
    vfloat slope;
    hit.normal = normal_at(direction, hit.found, &near, scene, beam, &slope, &hit.smooth);
    hit.smooth = v_andnot(at->deep, hit.smooth);
    ACTIVE(v_count(hit.found));
    COUNT(finish_hit, end);
    hit.shape = v_select(hit.found, near.shape, hit.shape);
    vfloat more = v_zero_where(at->deep, newton(near.distance, slope, way));
    hit.t = at->before + (at->t + (at->last + more));
    hit.point = at->origin;
    hit.point.lo = vec_along(hit.point.lo, direction, more);
    approach_moved(more, scene, beam);
    return hit;
}

// Takes the rays from where bulb/bulb_stream.c or bulb/bulb_single.c has left them. Rays that have ended there are done.
// The others have no Mandelbulb before them any more, and march on among the other shapes.
static void resume_march(struct march_state packets[GROUP], const struct ray_group *rays,
                         struct trace_context *world) {
    COUNT(resume_march, call);
    const struct worker_scratch *scratch = world->scratch;
    struct packet_group *group = &world->group;
    struct shape_list all = group->beam[0].list;
    for (int k = 0, slot = rays->marched; k < GROUP; k++, slot += LANES) {
        struct march_state *at = &packets[k];
        COUNT(resume_march, packet);
        vfloat found = v_load(&scratch->marched[MARCH_FOUND][slot]);
        vmask over = v_and(rays->active[k], v_cmp_ge(found, v_splat(0.0f)));
        at->t = v_select_or_zero(rays->active[k], v_load(&scratch->marched[MARCH_T][slot]));
        at->start = v_zero_where(over, at->t);
        at->last = v_select_or_zero(over, v_load(&scratch->marched[MARCH_LAST_STEP][slot]));
        at->evals = v_select_or_zero(rays->active[k], v_load(&scratch->marched[MARCH_EVALS][slot]));
        at->found = v_and(over, v_cmp_gt(found, v_splat(0.5f)));
        at->told = world->lone ? at->found : v_mask_none();
        group->live[k] = v_andnot(over, rays->active[k]);
        group->beam[k].list = rays->others;
    }
    march(packets, rays, world);
    for (int k = 0; k < GROUP; k++)
        group->beam[k].list = all;
}

// Marches the rays of the group and returns their hits. Rays that marched on from a hit are landed again until all are.
void ray_march(const struct ray_group *rays, struct trace_context *world, struct hit hit[GROUP]) {
    COUNT(ray_march, call);
    const struct prepared *scene = world->scene;
    struct march_state packets[GROUP];
    unsigned going = 0;
    bool recalled = rays->marched < 0;
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(v_count(rays->active[k]));
        vfloat zero = v_splat(0.0f);
        packets[k] = (struct march_state){.origin = rays->origin[k]};
        packets[k].before = packets[k].t = packets[k].last = packets[k].evals = zero;
        packets[k].found = packets[k].deep = packets[k].told = v_mask_none();
        packets[k].inside = v_splat(-1.0f);
        packets[k].start = rays->start;
        world->group.live[k] = rays->active[k];
        if (!v_any(rays->active[k]))
            continue;
        going |= 1u << k;
        approach_origins(rays->origin[k], scene, &world->group.beam[k]);
        approach_directions(rays->direction[k], scene, &world->group.beam[k]);
    }
    while (going) {
        vmask settled[GROUP];
        for (int k = 0; k < GROUP; k++)
            settled[k] = packets[k].found;
        if (recalled)
            march(packets, rays, world);
        else
            resume_march(packets, rays, world);
        recalled = true;
        for (int k = 0; k < GROUP; k++)
            if (going >> k & 1 && !land_hits(&packets[k], settled[k], rays->direction[k], scene,
                                             &world->group.beam[k], &world->group.live[k]))
                going &= ~(1u << k);
    }
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(v_count(packets[k].found));
        hit[k] = finish_hit(&packets[k], rays->direction[k], scene, &world->group.beam[k]);
    }
}
