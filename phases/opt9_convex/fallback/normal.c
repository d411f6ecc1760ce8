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
    switch (s->type) {
    case SHAPE_SPHERE: break;
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX: exact = box_gradient(p, s); break;
    case SHAPE_TORUS: exact = torus_gradient(p, s); break;
    case SHAPE_CONE: exact = cone_gradient(p, s); break;
    case SHAPE_OCTAHEDRON: exact = octahedron_gradient(p); break;
    case SHAPE_PLANE: exact = vec_set(s->size); break;
    case SHAPE_GROUP:
        exact = turned_back(s, field_surface(s->field, p, found).normal);
        return vec_select(near, rounded, exact);
    default: return rounded;
    }
    exact = turned_back(s, exact);
    exact = vec_scale(exact, v_splat(1.0f) / vec_norm(exact));
    rounded = vec_scale(rounded, v_splat(1.0f / step));
    struct vec apart = vec_along(rounded, exact, v_splat(-1.0f));
    vfloat size = v_max(v_abs(p.x), v_max(v_abs(p.y), v_abs(p.z)));
    vfloat noise =
        v_madd(size, v_splat(0x1p-20f / step), v_splat(1e-3f)); // 16 half ulps, and curvature
    vmask edge =
        v_and(v_cmp_gt(vec_dot(apart, apart), noise * noise), v_cmp_lt(noise, v_splat(0.5f)));
    if (s->eval == EVAL_LINEAR) // its own difference is the closed form
        edge = v_and(edge, near);
    return vec_select(edge, rounded, exact);
}

// Returns unit normals towards the rays. *slope: how fast the distance falls along the ray, from a closed
// form; 1e30 where a difference was used, which is no slope to divide by at an edge.
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
    vfloat length = vec_norm(gradient);
    vfloat along = vec_dot(direction, gradient);
    *slope = v_select(v_cmp_lt(v_abs(length - v_splat(1.0f)), v_splat(1e-4f)), v_abs(along),
                      v_splat(1e30f));
    vmask away = v_cmp_gt(along, v_splat(0.0f));
    struct vec n = vec_scale(gradient, v_negate_where(away, v_splat(1.0f) / length));
    // A zero gradient, as at a centre: the normal points along the ray. 1e-18: its square is a normal float.
    vmask clear = v_and(v_cmp_gt(length, v_splat(1e-18f)), v_cmp_lt(length, v_splat(1e18f)));
    n = vec_select(clear, n, vec_scale(direction, v_splat(-1.0f)));
    return (struct vec){v_select_or_zero(found, n.x), v_select_or_zero(found, n.y),
                        v_select_or_zero(found, n.z)};
}
