// Shadow rays that need no march. The soft shadow is the paper's: the least of strength·√(h² − y²)/(t − y) over the
// steps of a march by the distance h to the scene, y = h²/(2·previous h). For most rays a cone decides it (PROOFS.md).
#include "core/packet_group.h"
#include "core/ray_queues.h"
#include "core/shape_distances.h"
#include "core/trace.h"
#include "core/trace_context.h"
#include "packet/light_bundle.h"
#include "shadow/shadow_cone.h"

// Sets the bundle of the group's shadow rays. Returns false if it is too wide, or if no hit faces the light.
static bool bundle_of_group(const struct hit *hit, const struct lighting *light,
                            const struct view *view, struct light_bundle *ball) {
    vfloat none = v_splat(INFINITY);
    struct vec least = {none, none, none}, most = {-none, -none, -none};
    for (int k = 0; k < GROUP; k++) {
        vmask front = light[k].front;
        if (!v_any(front))
            continue;
        struct vec p = hit[k].point.hi;
        least = (struct vec){v_select(front, v_min(p.x, least.x), least.x),
                             v_select(front, v_min(p.y, least.y), least.y),
                             v_select(front, v_min(p.z, least.z), least.z)};
        most = (struct vec){v_select(front, v_max(p.x, most.x), most.x),
                            v_select(front, v_max(p.y, most.y), most.y),
                            v_select(front, v_max(p.z, most.z), most.z)};
    }
    const vfloat low[3] = {least.x, least.y, least.z}, high[3] = {most.x, most.y, most.z};
    float from[3], to[3], at[3];
    for (int k = 0; k < 3; k++) {
        from[k] = v_reduce_min(low[k]);
        to[k] = -v_reduce_min(-high[k]);
        at[k] = (float)view->light_position[k];
    }
    return light_bundle_of(from, to, at, ball);
}

void list_occluders(const struct hit *hit, const struct lighting *light,
                    struct trace_context *world) {
    const struct prepared *scene = world->scene;
    struct ray_queues *queues = world->queues;
    struct light_bundle ball;
    bool known = bundle_of_group(hit, light, world->view, &ball);
    queues->occluder_count = 0;
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *s = &scene->primitives[i];
        if (!known || s->eval == EVAL_LINEAR ||
            !bundle_misses(&ball, s->position, s->bound, s->slope_lit))
            queues->occluders[queues->occluder_count++] = i;
    }
}

vmask trivially_lit(const struct hit *hit, const struct lighting *light,
                    const struct packet_rays *packet, const struct trace_context *world) {
    const struct prepared *scene = world->scene;
    float q = scene->lit_slope;
    struct vec point = hit->point.hi;
    vmask clear = light->front;
    if (scene->model.shadows == SHADOWS_HARD) // its own shape must fall away by the slope, too
        clear = v_and(clear, v_cmp_ge(light->facing, v_splat(q)));
    for (int k = 0; k < world->queues->occluder_count && v_any(clear); k++) {
        int i = world->queues->occluders[k];
        const struct primitive *s = &scene->primitives[i];
        vmask same = v_and(is_shape(hit->shape, i), hit->smooth), here;
        if (s->eval == EVAL_LINEAR) {
            vfloat slope = vec_dot(vec_set(s->normal), light->to_light);
            here = v_or(same, plane_clears(height_over(s, point), slope, q, &scene->model));
        } else {
            ACTIVE(v_count(clear));
            COUNT(cone_test, call);
            here = cone_misses(shadow_cone_to(to_centre(s, point), light->to_light, s), s);
            if (v_any(v_and(same, v_andnot(here, clear))))
                here = v_or(here, v_and(same, convex_from(s, packet->local[i].origin, light->facing,
                                                          scene)));
        }
        clear = v_and(clear, here);
    }
    return clear;
}

// Returns half of the rate at which the distance's slope grows along l, from a point with normal n: the surface's
// curvature.
static vfloat half_curvature(struct vec p, struct vec n, struct vec l, vfloat facing,
                             const struct primitive *s) {
    vfloat zero = v_splat(0.0f);
    if (s->type == SHAPE_SPHERE)
        return v_nmadd(facing, facing, v_splat(1.0f)) * v_splat(0.5f / s->a);
    if (s->type != SHAPE_CONE && s->type != SHAPE_TORUS)
        return zero;
    vfloat square = v_max(v_madd(p.x, p.x, p.z * p.z), v_splat(1e-30f));
    vfloat round = v_msub(p.x, l.z, p.z * l.x),
           round_sq = round * round; // along the ring, times its radius
    vfloat ring = v_splat(0.5f) * round_sq * v_madd(n.x, p.x, n.z * p.z) / (square * square);
    if (s->type == SHAPE_CONE)
        return ring;
    vfloat tangent = v_nmadd(facing, facing, v_splat(1.0f));
    return v_madd(v_max(tangent - round_sq / square, zero), v_splat(0.5f / s->b), ring);
}

vfloat self_shadow(const struct primitive *s, struct vec local, struct vec normal,
                   const struct lighting *light, const struct model *model) {
    vfloat one = v_splat(1.0f), strength = v_splat((float)model->shadow_strength),
           facing = light->facing;
    vfloat t = v_splat((float)model->march.surface_offset),
           hit = v_splat((float)model->march.hit_distance);
    vfloat half = v_splat(0.0f);
    if (s->eval != EVAL_LINEAR)
        half = half_curvature(local, turned(s, normal), turned(s, light->to_light), facing, s);
    vfloat u = v_max(v_madd(half, t, facing), v_splat(1e-12f)), further = v_madd(t, u, t);
    vfloat v = v_madd(half, further, facing), ratio = v * (one + u) / u;
    vfloat inside = v_nmadd(v_splat(0.25f) * ratio, ratio, one);
    vfloat ahead = v_nmadd(v_splat(0.5f) * ratio, v, one);
    vfloat term = strength * v * v_sqrt(inside) / ahead;
    // A march within the hit distance at its first step has no term. A ray that leaves along the normal has no second
    // one: it is 0/0.
    vmask first = v_cmp_ge(u * t, hit), second = v_and(first, v_cmp_ge(v * further, hit));
    second = v_and(second, v_cmp_gt(v_min(inside, ahead), v_splat(0.0f)));
    if (model->march.max_steps < 2)
        second = v_mask_none();
    vfloat least = v_select(first, v_min(one, strength * u), one);
    return v_select(second, v_min(term, least), least);
}
