// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). A packet of rays marches until the last is done.
#include "march/march_step.h"
#include "rods.h"
#include "simd/point.h"

// Where the rays of a packet are: at the distance before + t + last. t and the last step apart: their
// sum, rounded, would lose what places the hit on the surface.
struct march_state {
    struct point origin; // at the distance `before`
    vfloat before, t, last, evals;
    vfloat start; // where the first march begins
    int cap;      // of its evaluations
    vmask found;
    struct bounds_exit exit;
    int left;   // steps that every ray has before its cap
    vmask deep; // a ray that started inside a shape has stepped back out of it
    vfloat inside;
    struct hit_surroundings near;
};

// Rays that march on from a hit have had some of their evaluations.
static int steps_left(const struct march_state *at, vmask live) {
    float evals[LANES];
    v_store(v_select_or_zero(live, at->evals), evals);
    int had = 0;
    for (int lane = 0; lane < LANES; lane++)
        had = (int)evals[lane] > had ? (int)evals[lane] : had;
    return at->cap - had;
}

// Some rays have ended: those that have reached a surface, and others. Each has a cap of its own, whatever its
// neighbours had.
__attribute__((noinline)) static void end_rays(struct march_state *at, int step, int k, vmask going,
                                               vmask inside, struct packet_group *group) {
    COUNT(end_rays, call);
    vmask live = group->live[k], reached = v_andnot(going, live);
    at->last = v_select(reached, group->distance[k], at->last);
    at->found = v_or(at->found, reached);
    vfloat evals = at->evals + v_splat((float)step);
    if (step >= at->left) {
        COUNT(end_rays, cap);
        inside = v_cmp_lt_in(inside, evals, v_splat((float)at->cap));
    }
    at->evals = v_select(v_andnot(inside, live), evals, at->evals);
    group->live[k] = inside;
    group->high[k] = v_select(inside, group->high[k], v_splat(-INFINITY));
}

// The step-th step of a packet, its distance known. False after the last.
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
    end_rays(at, step, k, going, inside, group);
    return v_any(group->live[k]);
}

// Until every ray has ended, by the hit test of a float march, which errs with t.
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
        at->left = steps_left(at, group->live[k]);
        group->t[k] = v_select(group->live[k], at->start, at->t); // what is done stays where it is
        at->start = v_splat(0.0f);
        at->last = v_zero_where(group->live[k], at->last);
    }
    struct sole_shape alone = {.shape = -1};
    for (int step = 1; group->count > 0; step++) {
        scene_distances(group, scene, &alone);
        for (int i = 0; i < group->count;) {
            int k = group->list[i];
            if (march_step(&packets[k], step, k, group, &scene->model)) {
                i++;
                continue;
            }
            packets[k].t = group->t[k];
            group->list[i] = group->list[--group->count];
        }
    }
}

// The shape that a ray was in when its march ended: the step back may have brought it nearer to another.
__attribute__((noinline)) static void shape_inside(vmask deep, vfloat t,
                                                   const struct prepared *scene,
                                                   const struct local_ray *approach,
                                                   vfloat *shape) {
    ACTIVE(v_count(deep));
    COUNT(shape_inside, call);
    vfloat inside = v_splat(-1.0f);
    nearest_shape_at(approach, t, scene, deep, &inside);
    *shape = v_select(deep, inside, *shape);
}

// Each hit becomes an origin, in the frames of all shapes: there the distance is exact to the size of
// a shape, not of the way to it. A hit that is still further than twice the hit distance, because
// the march erred or its test was wider than the scene's, marches on from there: whether there is one.
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
        shape_inside(sunk, at->t, scene, beam->approach, &at->inside);
    at->deep = v_or(at->deep, sunk);
    // What has settled stays as it is to the bit, whatever its neighbours do.
    at->origin =
        point_select(settled, at->origin, point_at(at->origin, direction, at->t, at->last));
    approach_origins(at->origin, scene, beam);
    at->near = near_hit(at->found, scene, beam);
    vmask off = v_and(
        at->found, v_andnot(v_or(at->deep, settled), v_cmp_gt(at->near.distance, v_splat(twice))));
    if (!v_any(off))
        return false;
    ACTIVE(v_count(off));
    COUNT(land_hits, on);
    // From where it surely was before that surface, be it as thin as an ulp of t.
    vfloat back = v_select_or_zero(off, at->t * v_splat(-0x1p-22f));
    at->origin.lo = vec_along(at->origin.lo, direction, back);
    at->before = v_select(off, at->before + (at->t + (at->last + back)), at->before);
    approach_origins(at->origin, scene, beam);
    approach_directions(direction, scene, beam->approach);
    at->found = v_andnot(off, at->found);
    *live = v_cmp_lt_in(off, at->evals, v_splat((float)at->cap));
    return v_any(*live);
}

static struct hit finish_hit(struct march_state *at, struct vec direction,
                             const struct prepared *scene, struct packet_rays *beam) {
    COUNT(finish_hit, call);
    struct hit hit = {.found = at->found, .shape = v_splat(-1.0f), .evals = at->evals};
    if (!v_any(at->found))
        return hit;
    vfloat way = at->before + at->t;
    vmask unmoved = v_cmp_ge(v_splat(0.0f), way); // hits wherever it starts
    hit.found = v_and(hit.found, v_or(within(at->origin, &scene->model), unmoved));
    struct hit_surroundings near = at->near;
    if (v_any(at->deep)) {
        COUNT(finish_hit, deep);
        vmask other = v_cmp_ge(v_abs(near.shape - at->inside), v_splat(0.5f));
        near.contact = v_or(near.contact, v_and(at->deep, other));
        near.shape = v_select(at->deep, at->inside, near.shape);
    }
    vfloat slope;
    hit.normal = normal_at(direction, hit.found, &near, scene, beam->approach, &slope);
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

void ray_march(const struct ray_group *rays, struct trace_context *world, struct hit hit[GROUP]) {
    COUNT(ray_march, call);
    const struct prepared *scene = world->scene;
    struct march_state packets[GROUP];
    unsigned going = 0;
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(v_count(rays->active[k]));
        vfloat zero = v_splat(0.0f);
        packets[k] = (struct march_state){.origin = rays->origin[k]};
        packets[k].before = packets[k].t = packets[k].last = packets[k].evals = zero;
        packets[k].start = rays->start[k];
        packets[k].cap = rays->cap;
        packets[k].found = packets[k].deep = v_mask_none();
        packets[k].inside = v_splat(-1.0f);
        world->group.live[k] = rays->active[k];
        if (!v_any(rays->active[k]))
            continue;
        going |= 1u << k;
        approach_origins(rays->origin[k], scene, &world->group.beam[k]);
        approach_directions(rays->direction[k], scene, world->group.beam[k].approach);
    }
    while (going) {
        vmask settled[GROUP];
        for (int k = 0; k < GROUP; k++)
            settled[k] = packets[k].found;
        march(packets, rays, world);
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
