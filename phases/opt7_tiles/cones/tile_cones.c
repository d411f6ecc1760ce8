// Cones of camera rays. A cone's axis stands at t, and its rays are within spread·t of it. All rays may go on by
// d(axis) − spread·t, because the ball of radius d around the axis holds no surface. A distance is lowered by its
// rounding error first.
#include "cones/tile_cones.h"
#include "cones/distance_bounds.h"
#include "core/local_rays.h"

enum { MAX_CONE_STEPS = 512 };

// A cone touches a shape once the gap to it is below this part of spread·t.
#define TOUCH_GAP 0.5f

// The result of one step: the cones that touch a shape, the least distance to a shape not met, and the depth of the
// axis in the shapes met.
struct cone_step {
    vmask touched;
    vfloat least, depth;
};

static struct cone_step touch_shapes(vfloat t, vfloat radius, vfloat touch, vmask live,
                                     struct shape_list offered, const struct prepared *scene,
                                     struct march_scratch *scratch) {
    struct cone_step found = {v_mask_none(), v_splat(INFINITY), v_splat(INFINITY)};
    for (int n = 0; n < offered.count; n++) {
        int i = offered.shape[n];
        const struct primitive *primitive = &scene->primitives[i];
        if (primitive->trust == BOUND_NONE)
            continue;
        vfloat d = lower_bound(&scratch->axis[i], t, primitive);
        vmask here = v_cmp_lt_in(live, d, touch);
        vmask met = scratch->met[i] = v_or(scratch->met[i], here);
        found.touched = v_or(found.touched, here);
        found.least = v_min(v_select(met, v_splat(INFINITY), d), found.least);
        if (primitive->trust != BOUND_LIPSCHITZ)
            continue;
        vfloat depth = upper_bound(d, primitive) + radius;
        found.depth = v_min(v_select(met, depth, v_splat(INFINITY)), found.depth);
    }
    return found;
}

static void touch_all(vmask lanes, struct shape_list offered, vmask *met) {
    for (int n = 0; n < offered.count; n++)
        met[offered.shape[n]] = v_or(met[offered.shape[n]], lanes);
}

static struct packet_rays axis_rays(struct march_scratch *scratch, struct shape_list list) {
    return single_packet(scratch->axis, list, scratch->probe_wake);
}

void set_cone_origins(struct point eye, const struct prepared *scene,
                      struct march_scratch *scratch) {
    struct packet_rays packet = axis_rays(scratch, scene->all);
    set_local_origins(eye, scene, &packet);
}

void march_cones(struct point eye, vmask active, struct shape_list offered,
                 struct cone_packet *cones, const struct prepared *scene,
                 struct march_scratch *scratch) {
    const struct limits *limits = &scene->model.march;
    vfloat zero = v_splat(0.0f), bounds = v_splat((float)limits->bounds_radius);
    vfloat from_centre = vec_dot(eye.hi, eye.hi);
    vfloat linear = v_splat(2.0f) * vec_dot(eye.hi, cones->axis);
    vfloat furthest = (bounds + v_sqrt(from_centre)) * v_splat(1.0f + 0x1p-10f);
    vfloat close = v_splat(near_distance(limits)), t = cones->start;
    vfloat touch_slope = cones->spread * v_splat(TOUCH_GAP),
           outer = bounds * v_splat(1.0f + 0x1p-16f);
    struct packet_rays packet = axis_rays(scratch, offered);
    set_local_directions(cones->axis, scene, &packet);
    // From outside of the bounds, a ray's first step decides whether it goes on. So nothing is known about it.
    vmask live = v_and(active, v_cmp_lt(from_centre, bounds * bounds * v_splat(1.0f - 0x1p-18f)));
    vmask met = v_andnot(live, active), at_camera = v_cmp_ge(zero, t);
    for (int i = 0; i < scene->model.shape_count; i++)
        scratch->met[i] = v_mask_none();
    for (int n = 0; n < offered.count; n++) {
        int i = offered.shape[n];
        scratch->met[i] =
            scene->primitives[i].trust == BOUND_NONE ? active : v_andnot(live, active);
        met = v_or(met, scratch->met[i]);
    }
    for (int step = 0; step < MAX_CONE_STEPS && v_any(live); step++) {
        ACTIVE(v_count(live));
        COUNT(cone_step, call);
        // The cone's own radius, t's rounding, and the distance at which a ray counts as hit.
        vfloat radius = v_madd(cones->spread, t, v_madd(t, v_splat(0x1p-18f), close));
        vfloat touch = v_madd(touch_slope, t, radius);
        struct cone_step around = touch_shapes(t, radius, touch, live, offered, scene, scratch);
        vmask first = v_andnot(met, around.touched);
        cones->start = v_select(first, t, cones->start);
        met = v_or(met, around.touched);
        // A ray that starts inside a shape is hit behind its start, near to any shape there.
        if (step == 0 && v_any(v_and(first, at_camera))) {
            touch_all(v_and(first, at_camera), offered, scratch->met);
            live = v_andnot(v_and(first, at_camera), live);
        }
        // Every ray of the cone has been hit, or is out of the bounds.
        vmask hit = v_cmp_lt(around.depth, zero);
        t = v_add_where(live, t, around.least - radius);
        vfloat wide = v_madd(cones->spread, t, outer);
        vmask out =
            v_or(v_cmp_gt(v_madd(t, t + linear, from_centre), wide * wide), v_cmp_ge(t, furthest));
        cones->start = v_select(v_and(live, v_andnot(met, out)), v_splat(INFINITY), cones->start);
        live = v_andnot(v_or(hit, out), live);
    }
    if (v_any(live)) { // out of steps: the start holds as far as the cone has come
        cones->start = v_select(v_andnot(met, live), t, cones->start);
        touch_all(live, offered, scratch->met);
    }
    cones->start =
        v_select(v_cmp_lt(cones->start, v_splat(INFINITY)),
                 v_max(v_nmadd(cones->start, v_splat(0x1p-18f), cones->start), zero), cones->start);
}

struct shape_list list_wanted(const bool *wanted, const struct prepared *scene, int *shapes) {
    const struct shape_list *all = &scene->all;
    int count = 0, same = 0, steady = 0, *order = shapes + all->count;
    for (int n = 0; n < all->count; n++) {
        shapes[count] = n;
        count += wanted[n];
        order[same] = all->order[n];
        same += wanted[all->order[n]];
        steady += n < all->steady && wanted[all->order[n]];
    }
    return (struct shape_list){count, steady, shapes, order, false};
}

struct shape_list list_wanted_hits(const bool *wanted, const struct prepared *scene, int *shapes) {
    struct shape_list all = scene->all;
    for (int i = 0; i < all.count; i++)
        all.fractal |= wanted[i] && is_fractal(scene->primitives[i].type);
    return all.fractal ? all : list_wanted(wanted, scene, shapes);
}

struct shape_list list_for_children(unsigned some, const vmask *met, const struct prepared *scene,
                                    struct march_scratch *scratch, int *shapes) {
    for (int i = 0; i < scene->model.shape_count; i++)
        scratch->wanted[i] = (v_mask_bits(met[i]) & some) != 0;
    return list_wanted(scratch->wanted, scene, shapes);
}

struct shape_list list_of_cone(int lane, const struct prepared *scene,
                               struct march_scratch *scratch, float *start) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        scratch->wanted[i] = v_mask_bits(scratch->met[i]) >> lane & 1;
        if (scratch->wanted[i] && is_fractal(scene->primitives[i].type))
            *start = 0.0f;
    }
    return list_wanted_hits(scratch->wanted, scene, scratch->patch);
}
