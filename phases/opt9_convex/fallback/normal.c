// Normals of marched hits: gradients in closed form, or differences of distances.
#include "fallback/trace.h"

// The scene asks for forward differences over normal_step, which in float are noise in the third digit. So
// the gradient of the shape hit is used where both agree to that noise, its difference near an edge, and the
// whole scene's where another shape is within the step. In world axes, of any length.
static struct vec box_gradient(struct vec p, const struct primitive *s) {
    vfloat zero = v_splat(0.0f);
    vfloat x = v_abs(p.x) - v_splat(s->size[0]);
    vfloat y = v_abs(p.y) - v_splat(s->size[1]);
    vfloat z = v_abs(p.z) - v_splat(s->size[2]);
    vfloat most = v_max(x, v_max(y, z));
    // Outside: away from the nearest point. Inside: along the axis of the nearest face.
    vmask outside = v_cmp_gt(most, zero), on_x = v_cmp_ge(x, most), on_y = v_cmp_ge(y, most);
    vfloat one = v_splat(1.0f);
    struct vec face = {v_select_or_zero(on_x, one), v_select_or_zero(v_andnot(on_x, on_y), one),
                       v_zero_where(v_or(on_x, on_y), one)};
    struct vec away = {v_max(x, zero), v_max(y, zero), v_max(z, zero)};
    struct vec g = vec_select(outside, away, face);
    return (struct vec){v_copysign(g.x, p.x), v_copysign(g.y, p.y), v_copysign(g.z, p.z)};
}

static struct vec torus_gradient(struct vec p, const struct primitive *s) {
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vfloat outward = v_splat(1.0f) - v_splat(s->a) / v_max(radius, v_splat(1e-30f));
    return (struct vec){p.x * outward, p.y, p.z * outward};
}

static struct vec cone_gradient(struct vec p, const struct primitive *s) {
    vfloat zero = v_splat(0.0f);
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vfloat x = radius - v_splat(s->b), y = p.y - v_splat(s->c);
    vfloat rim = v_select(v_cmp_lt(p.y, zero), v_splat(s->a), v_splat(s->b));
    vfloat cap_x = v_max(radius - rim, zero), cap_y = v_abs(p.y) - v_splat(s->c);
    vfloat across =
        v_madd(x, v_splat(s->slope[0]), y * v_splat(s->slope[1])) * v_splat(-s->per_slope_sq);
    vfloat along = v_min(v_max(across, zero), v_splat(1.0f));
    vfloat side_x = v_madd(v_splat(s->slope[0]), along, x);
    vfloat side_y = v_madd(v_splat(s->slope[1]), along, y);
    // Beside the slope, the slope's normal: on the surface the vector to it is rounding error.
    vmask beside = v_and(v_cmp_gt(across, zero), v_cmp_lt(across, v_splat(1.0f)));
    vfloat out = v_select(beside, v_splat(s->slope[1]), side_x),
           up = v_select(beside, v_splat(-s->slope[0]), side_y);
    vmask cap =
        v_cmp_lt(v_madd(cap_x, cap_x, cap_y * cap_y), v_madd(side_x, side_x, side_y * side_y));
    vfloat cap_up =
        v_select(v_cmp_gt(cap_x, zero), cap_y, v_splat(1.0f)); // over the cap: straight up
    out = v_select(cap, cap_x, out);
    up = v_select(cap, v_copysign(cap_up, p.y), up);
    vfloat per_radius = out / v_max(radius, v_splat(1e-30f));
    return (struct vec){p.x * per_radius, up, p.z * per_radius};
}

static struct vec octahedron_gradient(struct vec p) {
    vfloat one = v_splat(1.0f);
    return (struct vec){v_copysign(one, p.x), v_copysign(one, p.y), v_copysign(one, p.z)};
}

// Returns the hit in the shape's frame, moved by `step` along a world axis; axis −1: not moved.
static struct vec moved_in(const struct primitive *s, const struct local_ray *ray, float step,
                           int axis) {
    struct vec p = ray->origin;
    if (axis < 0)
        return p;
    p = (struct vec){p.x + v_splat(step * s->turn[0][axis]), p.y + v_splat(step * s->turn[1][axis]),
                     p.z + v_splat(step * s->turn[2][axis])};
    return s->repeated ? vec_wrapped(s, p) : p;
}

static vfloat moved_power(const struct primitive *s, const struct local_ray *ray, float step,
                          int axis) {
    if (axis < 0)
        return ray->power;
    struct vec column = {v_splat(s->turn[0][axis]), v_splat(s->turn[1][axis]),
                         v_splat(s->turn[2][axis])};
    return v_madd(v_splat(step), v_madd(v_splat(2.0f), vec_dot(ray->origin, column), v_splat(step)),
                  ray->power);
}

static vfloat moved_distance(const struct primitive *s, const struct local_ray *ray, vmask done,
                             float step, int axis) {
    if (s->eval == EVAL_POWER)
        return sdf_power(moved_power(s, ray, step, axis), s);
    if (s->eval == EVAL_LINEAR) {
        if (axis < 0)
            return ray->origin.x;
        return v_madd(v_splat(s->normal[axis]), v_splat(step), ray->origin.x);
    }
    return distance_at(moved_in(s, ray, step, axis), s, done);
}

// Returns the differences of the distance to `count` shapes from `first` on: of one, or of the whole scene, as in the
// other phases.
static struct vec difference(int first, int count, vmask done, float step,
                             const struct trace_context *world) {
    vfloat f[4];
    for (int axis = -1; axis < 3; axis++) {
        f[axis + 1] = v_splat(INFINITY);
        for (int i = first; i < first + count; i++)
            f[axis + 1] = v_min(moved_distance(&world->scene->primitives[i], &world->local_rays[i],
                                               done, step, axis),
                                f[axis + 1]);
    }
    return (struct vec){f[1] - f[0], f[2] - f[0], f[3] - f[0]};
}

struct hit_surroundings near_hit(vmask found, const struct trace_context *world) {
    const struct prepared *scene = world->scene;
    vfloat least = v_splat(INFINITY), second = least, shape = v_splat(-1.0f);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *s = &scene->primitives[i];
        vfloat distance = moved_distance(s, &world->local_rays[i], v_not(found), 0, -1);
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
        rounded = difference(shape, 1, v_not(found), step, world);
    if (v_any(near))
        rounded = vec_select(
            near, difference(0, world->scene->model.shape_count, v_not(near), step, world),
            rounded);
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
