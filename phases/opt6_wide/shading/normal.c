// Normals of hits.
#include "core/packet_group.h"
#include "core/trace.h"
#include "groups/field_part.h"
#include "shading/gradients.h"

// Returns the forward differences of the whole scene's distance.
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
    switch (primitive->type) {
    case SHAPE_SPHERE: break;
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX: exact = box_gradient(p, primitive); break;
    case SHAPE_TORUS: exact = torus_gradient(p, primitive); break;
    case SHAPE_CONE: exact = cone_gradient(p, primitive); break;
    case SHAPE_OCTAHEDRON: exact = octahedron_gradient(p); break;
    case SHAPE_PLANE: exact = vec_set(primitive->size); break;
    case SHAPE_GROUP: exact = field_at_origin(local, primitive, found).gradient; break;
    default: return rounded;
    }
    exact = turned_back(primitive, exact);
    if (primitive->eval != EVAL_FIELD) // a group's field is not as steep everywhere
        exact = vec_scale(exact, v_splat(1.0f) / vec_norm(exact));
    rounded = vec_scale(rounded, v_splat(1.0f / step));
    struct vec apart = vec_along(rounded, exact, v_splat(-1.0f));
    vfloat size = v_max(v_abs(p.x), v_max(v_abs(p.y), v_abs(p.z)));
    vfloat noise =
        v_madd(size, v_splat(0x1p-20f / step), v_splat(1e-3f)); // 16 half ulps, and curvature
    vmask edge =
        v_and(v_cmp_gt(vec_dot(apart, apart), noise * noise), v_cmp_lt(noise, v_splat(0.5f)));
    if (primitive->eval == EVAL_LINEAR) // its difference equals the closed form
        edge = v_and(edge, near);
    return vec_select(edge, rounded, exact);
}

// The gradient is formed once for each shape that the packet hit. The slope comes from a closed form, which has unit
// length. Where a difference is used instead, at an edge or through a thin plate, it would not be a slope to divide
// by.
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
    vfloat length = vec_norm(gradient);
    vfloat along = vec_dot(direction, gradient);
    vfloat slope = v_select(v_cmp_lt(v_abs(length - v_splat(1.0f)), v_splat(1e-4f)), v_abs(along),
                            v_splat(1e30f));
    vmask away = v_cmp_gt(along, v_splat(0.0f));
    struct vec n = vec_scale(gradient, v_negate_where(away, v_splat(1.0f) / length));
    // Without a direction, as at a centre, the normal is towards the ray. 1e-18: its square is a normal float.
    vmask clear = v_and(v_cmp_gt(length, v_splat(1e-18f)), v_cmp_lt(length, v_splat(1e18f)));
    n = vec_select(clear, n, vec_scale(direction, v_splat(-1.0f)));
    n = (struct vec){v_select_or_zero(found, n.x), v_select_or_zero(found, n.y),
                     v_select_or_zero(found, n.z)};
    return (struct hit_normal){n, slope, away};
}
