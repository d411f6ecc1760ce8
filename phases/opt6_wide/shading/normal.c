// Normals of hits.
#include "core/packet_group.h"
#include "core/trace.h"
#include "groups/field_part.h"
#include "shading/gradients.h"

static struct vec scene_difference(vmask live, float step, const struct prepared *scene,
                                   const struct packet_rays *packet) {
    const struct shape_list *list = shapes_of(packet, scene);
    vfloat f[4];
    for (int axis = -1; axis < 3; axis++) {
        f[axis + 1] = v_splat(INFINITY);
        for (int n = 0; n < list->count; n++) {
            int i = list->shape[n];
            f[axis + 1] =
                v_min(moved_distance(&scene->primitives[i], &packet->local[i], live, step, axis),
                      f[axis + 1]);
        }
    }
    return (struct vec){f[1] - f[0], f[2] - f[0], f[3] - f[0]};
}

// Finds the nearest shape at the origins of the packet, and sets the packet's wakes for a ray that starts there.
struct hit_surroundings near_hit(vmask found, const struct prepared *scene,
                                 struct packet_rays *packet) {
    vfloat least = v_splat(INFINITY), second = least, shape = v_splat(-1.0f);
    const struct shape_list *list = shapes_of(packet, scene);
    for (int n = 0; n < list->count; n++) {
        int i = list->shape[n];
        const struct primitive *primitive = &scene->primitives[i];
        vfloat distance = moved_distance(primitive, &packet->local[i], found, 0, -1);
        shape = v_select(v_cmp_lt(distance, least), v_splat(primitive->index),
                         shape); // the first of equal ones
        second = v_min(second, v_max(distance, least));
        least = v_min(distance, least);
        if (primitive->steady) {
            *wake_of(packet, i) = wake_bound_inside(distance, primitive);
            packet->high = v_min(distance, packet->high);
        }
    }
    packet->high = packet->high + v_splat(1e-30f); // at distance 0 the shape is awake
    float step = (float)scene->model.march.normal_step;
    return (struct hit_surroundings){least, v_select(found, shape, v_splat(-1.0f)),
                                     v_and(found, v_cmp_lt(second, least + v_splat(2.0f * step)))};
}

// Returns the gradients of one shape at the hits `found`. Where another shape is in `contact`, the scene's difference
// is used.
static struct vec gradient_of(int shape, vmask found, vmask contact, float step,
                              const struct prepared *scene, const struct packet_rays *packet) {
    const struct primitive *primitive = &scene->primitives[shape];
    const struct local_ray *local = &packet->local[shape];
    vmask near = v_and(found, contact);
    struct vec p = moved_in(primitive, local, 0, -1);
    if (primitive->eval == EVAL_LINEAR) // it has a distance along its normal only
        p.y = p.z = v_splat(0.0f);
    struct vec exact = p, rounded = p;
    if (primitive->eval != EVAL_LINEAR && v_any(v_andnot(contact, found)))
        rounded = difference(primitive, local, found, step);
    if (v_any(near))
        rounded = vec_select(near, scene_difference(near, step, scene, packet), rounded);
    if (is_fractal(primitive->type))
        return rounded;
    exact = primitive->eval == EVAL_FIELD ? field_at_origin(local, primitive, found).gradient
                                          : gradient_in_axes(p, primitive);
    exact = turned_back(primitive, exact);
    if (primitive->eval != EVAL_FIELD) // a group's field is not as steep everywhere
        exact = vec_scale(exact, v_splat(1.0f) / vec_norm(exact));
    return closed_or_difference(exact, rounded, p, step, primitive->eval == EVAL_LINEAR, near);
}

// The gradient is formed once for each shape that the packet hit.
struct hit_normal normal_at(struct vec direction, vmask found, const struct hit_surroundings *near,
                            const struct prepared *scene, const struct packet_rays *packet) {
    float id[LANES], step = (float)scene->model.march.normal_step;
    v_store(near->shape, id);
    struct vec gradient = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (unsigned rest = v_mask_bits(found); rest;) {
        int i = (int)id[__builtin_ctz(rest)];
        vmask same = v_and(found, v_cmp_ge(v_splat(0.5f), v_abs(near->shape - v_splat((float)i))));
        gradient =
            vec_select(same, gradient_of(i, same, near->contact, step, scene, packet), gradient);
        rest &= ~v_mask_bits(same);
    }
    struct hit_normal at;
    at.normal = normal_of(gradient, direction, found, &at.inward, &at.slope);
    return at;
}
