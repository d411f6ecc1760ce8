// Normals of marched hits: gradients in closed form, or differences of distances.
#include "fallback/trace.h"
#include "shading/gradients.h"

// Returns the differences of the whole scene's distance, as in the other phases.
static struct vec scene_difference(vmask live, float step, const struct trace_context *world) {
    vfloat f[4];
    for (int axis = -1; axis < 3; axis++) {
        f[axis + 1] = v_splat(INFINITY);
        for (int i = 0; i < world->scene->model.shape_count; i++) {
            f[axis + 1] = v_min(moved_distance(&world->scene->primitives[i], &world->local_rays[i],
                                               live, step, axis),
                                f[axis + 1]);
        }
    }
    return (struct vec){f[1] - f[0], f[2] - f[0], f[3] - f[0]};
}

struct hit_surroundings near_hit(vmask found, const struct trace_context *world) {
    const struct prepared *scene = world->scene;
    vfloat least = v_splat(INFINITY), second = least, shape = v_splat(-1.0f);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *s = &scene->primitives[i];
        vfloat distance = moved_distance(s, &world->local_rays[i], found, 0, -1);
        shape = v_select(v_cmp_lt(distance, least), v_splat(s->index),
                         shape); // the first of equals
        second = v_min(second, v_max(distance, least));
        least = v_min(distance, least);
    }
    float step = (float)scene->model.march.normal_step;
    return (struct hit_surroundings){least, v_select(found, shape, v_splat(-1.0f)),
                                     v_and(found, v_cmp_lt(second, least + v_splat(2.0f * step)))};
}

// Returns the gradient at hits on one shape. contact: hits near another shape, which use the scene's
// difference.
static struct vec gradient_of(int shape, vmask found, vmask contact, float step,
                              const struct trace_context *world) {
    const struct primitive *s = &world->scene->primitives[shape];
    const struct local_ray *ray = &world->local_rays[shape];
    vmask near = v_and(found, contact);
    struct vec p = moved_in(s, ray, 0, -1);
    if (s->eval == EVAL_LINEAR) // only the height is set
        p.y = p.z = v_splat(0.0f);
    struct vec exact = p, rounded = p;
    if (s->eval != EVAL_LINEAR && v_any(v_andnot(contact, found)))
        rounded = difference(s, ray, found, step);
    if (v_any(near))
        rounded = vec_select(near, scene_difference(near, step, world), rounded);
    if (is_fractal(s->type))
        return rounded;
    if (IS_GROUP(s)) {
        exact = turned_back(s, field_surface(s->field, p, found).normal);
        return vec_select(near, rounded, exact);
    }
    exact = gradient_in_axes(p, s);
    exact = turned_back(s, exact);
    exact = vec_scale(exact, v_splat(1.0f) / vec_norm(exact));
    return closed_or_difference(exact, rounded, p, step, s->eval == EVAL_LINEAR, near);
}

struct vec normal_at(struct vec direction, vmask found, const struct hit_surroundings *near,
                     const struct trace_context *world, vfloat *slope) {
    float id[LANES], step = (float)world->scene->model.march.normal_step;
    v_store(near->shape, id);
    struct vec gradient = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (unsigned rest = v_mask_bits(found); rest;) {
        int i = (int)id[__builtin_ctz(rest)];
        vmask same = v_and(found, v_cmp_ge(v_splat(0.5f), v_abs(near->shape - v_splat((float)i))));
        gradient = vec_select(same, gradient_of(i, same, near->contact, step, world), gradient);
        rest &= ~v_mask_bits(same);
    }
    vmask away;
    return normal_of(gradient, direction, found, &away, slope);
}
