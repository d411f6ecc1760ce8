// Shading of hits: normals, light (B. T. Phong, "Illumination for computer generated pictures",
// CACM 18 (1975)), mirrors by recursion, fog.
#include "trace.h"

#include "packet/gradients.h" // needs trace.h

// The surfaces with those of hits on groups in their lanes. Precondition: the hits are the origins of
// world->local_rays.
static struct materials group_surfaces(vfloat shape, vmask found, const struct world *world,
                                       struct materials surface) {
    for (int i = 0; i < world->scene->model.shape_count; i++) {
        const struct primitive *primitive = &world->scene->primitives[i];
        vfloat apart = v_abs(shape - v_splat(primitive->index));
        vmask same = v_and(found, v_cmp_lt(apart, v_splat(0.5f)));
        if (primitive->type != SHAPE_GROUP || !v_any(same))
            continue;
        struct materials mixed =
            group_surface(world->local_rays[i].origin, primitive, &world->scene->model);
        mix_materials(same, &mixed, &surface);
    }
    return surface;
}

// Normals. By the scene's definition a normal is the forward difference of the scene's distance over
// normal_step. In float that difference has noise in its third digit: an ulp of the point over 1e-4.
// Three sources serve instead.
// - The closed-form gradient of the shape, where it agrees with the difference within that noise. Of a group, the
//   central difference over more steps.
// - The difference of the shape's distance, elsewhere: within a step of an edge, on a Mandelbulb.
// - The difference of the scene's distance, where another shape is within reach of the step.

// The hit in the frame of one shape, moved by `step` along an axis of the world, which is a column of
// the shape's matrix. Axis −1: not moved.
static struct vec moved_point(const struct primitive *primitive, const struct local_ray *ray,
                              float step, int axis) {
    COUNT(moved_point, call);
    struct vec p = ray->origin;
    if (axis < 0)
        return p;
    COUNT(moved_point, moved);
    COUNT(moved_point, scalar);
    p = (struct vec){p.x + v_splat(step * primitive->rotation[0][axis]),
                     p.y + v_splat(step * primitive->rotation[1][axis]),
                     p.z + v_splat(step * primitive->rotation[2][axis])};
    return primitive->repeated ? vec_wrapped(primitive, p) : p;
}

// The power of the moved hit with respect to a sphere.
static vfloat moved_power(const struct primitive *primitive, const struct local_ray *ray,
                          float step, int axis) {
    if (axis < 0)
        return ray->power;
    COUNT(moved_power, moved);
    struct vec column = {v_splat(primitive->rotation[0][axis]),
                         v_splat(primitive->rotation[1][axis]),
                         v_splat(primitive->rotation[2][axis])};
    return v_madd(v_splat(step), v_madd(v_splat(2.0f), vec_dot(ray->origin, column), v_splat(step)),
                  ray->power);
}

static vfloat moved_distance(const struct primitive *primitive, const struct local_ray *ray,
                             vmask done, float step, int axis) {
    COUNT(moved_distance, call);
    if (primitive->eval == POWER)
        return sdf_power(moved_power(primitive, ray, step, axis), primitive);
    if (primitive->eval == LINEAR) {
        if (axis < 0)
            return ray->origin.x;
        COUNT(moved_distance, moved);
        return v_madd(v_splat(primitive->normal[axis]), v_splat(step), ray->origin.x);
    }
    struct vec p = moved_point(primitive, ray, step, axis);
    return primitive->type == SHAPE_GROUP ? sdf_group(p, primitive)
                                          : distance_at(p, primitive, done);
}

// Forward differences of one shape's distance.
static struct vec difference(const struct primitive *primitive, const struct local_ray *ray,
                             vmask done, float step) {
    COUNT(difference, call);
    vfloat f[4];
    for (int axis = -1; axis < 3; axis++)
        f[axis + 1] = moved_distance(primitive, ray, done, step, axis);
    return (struct vec){f[1] - f[0], f[2] - f[0], f[3] - f[0]};
}

// The slope of a group's field by central differences over 16 steps, but at most 2^-10 of the group's size.
static struct vec group_gradient(const struct primitive *primitive, const struct local_ray *ray,
                                 vmask done, float step) {
    COUNT(group_gradient, call);
    COUNT(group_gradient, scalar);
    vfloat slope[3];
    float wide = fmaxf(step, fminf(16 * step, primitive->group.extent * 0x1p-10f));
    for (int axis = 0; axis < 3; axis++)
        slope[axis] = (moved_distance(primitive, ray, done, wide, axis) -
                       moved_distance(primitive, ray, done, -wide, axis)) *
                      v_splat(0.5f / wide);
    return (struct vec){slope[0], slope[1], slope[2]};
}

// Forward differences of the scene's distance, as in the other phases.
static struct vec scene_difference(vmask done, float step, const struct world *world) {
    ACTIVE(LANES - v_count(done));
    COUNT(scene_difference, call);
    vfloat f[4];
    for (int axis = -1; axis < 3; axis++) {
        f[axis + 1] = v_splat(INFINITY);
        for (int i = 0; i < world->scene->model.shape_count; i++) {
            COUNT(scene_difference, shape);
            f[axis + 1] = v_min(moved_distance(&world->scene->primitives[i], &world->local_rays[i],
                                               done, step, axis),
                                f[axis + 1]);
        }
    }
    return (struct vec){f[1] - f[0], f[2] - f[0], f[3] - f[0]};
}

struct nearest_shape near_hit(vmask found, const struct world *world) {
    COUNT(near_hit, call);
    COUNT(near_hit, scalar);
    const struct prepared *scene = world->scene;
    vfloat closest = v_splat(INFINITY), second = closest, shape = v_splat(-1.0f);
    for (int i = 0; i < scene->model.shape_count; i++) {
        COUNT(near_hit, shape);
        const struct primitive *primitive = &scene->primitives[i];
        vfloat distance = moved_distance(primitive, &world->local_rays[i], v_not(found), 0, -1);
        shape = v_select(v_cmp_lt(distance, closest), v_splat(primitive->index),
                         shape); // the first of equals
        second = v_min(second, v_max(distance, closest));
        closest = v_min(distance, closest);
    }
    float step = (float)scene->model.march.normal_step;
    return (struct nearest_shape){closest, v_select(found, shape, v_splat(-1.0f)),
                                  v_and(found, v_cmp_lt(second, closest + v_splat(2.0f * step)))};
}

// The gradient of the distance at the hits on one shape, in world axes. In `contact`, another shape is
// near and the difference of the scene decides.
static struct vec gradient_of(int shape, vmask found, vmask contact, float step,
                              const struct world *world) {
    ACTIVE(v_count(found));
    COUNT(gradient_of, call);
    const struct primitive *primitive = &world->scene->primitives[shape];
    const struct local_ray *ray = &world->local_rays[shape];
    vmask near = v_and(found, contact);
    struct vec p = moved_point(primitive, ray, 0, -1);
    if (primitive->eval == LINEAR) // its local ray has one coordinate
        p.y = p.z = v_splat(0.0f);
    struct vec exact = p, rounded = p;
    if (primitive->eval != LINEAR && v_any(v_andnot(contact, found)))
        rounded = difference(primitive, ray, v_not(found), step);
    if (v_any(near))
        rounded = vec_select(near, scene_difference(v_not(near), step, world), rounded);
    ACTIVE(v_count(found)); // again, because the calls above have set their own
    switch (primitive->type) {
    case SHAPE_SPHERE: break;
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX:
        COUNT(box_gradient, call);
        exact = box_gradient(p, primitive->box.half_size);
        break;
    case SHAPE_TORUS:
        COUNT(torus_gradient, call);
        exact = torus_gradient(p, primitive->torus.major_radius);
        break;
    case SHAPE_CONE:
        COUNT(cone_gradient, call);
        exact = cone_gradient(p, primitive->cone.bottom_radius, primitive->cone.top_radius,
                              primitive->cone.half_height, primitive->cone.side,
                              primitive->cone.inv_side_sq);
        break;
    case SHAPE_OCTAHEDRON:
        COUNT(octahedron_gradient, call);
        exact = octahedron_gradient(p);
        break;
    case SHAPE_PLANE: exact = vec_set(primitive->plane.normal); break;
    case SHAPE_GROUP: exact = group_gradient(primitive, ray, v_not(found), step); break;
    default: return rounded;
    }
    COUNT(gradient_of, scalar);
    if (primitive->type == SHAPE_GROUP) {
        COUNT(group_gradient, compared);
    } else {
        COUNT(gradient_of, closed);
        exact = turned_back(primitive, exact);
        exact = vec_scale(exact, v_splat(1.0f) / vec_norm(exact));
    }
    return closed_or_difference(exact, rounded, p, step, primitive->eval == LINEAR, near);
}

// Evaluates one gradient for each shape that the packet hits.
struct vec normal_at(struct vec direction, vmask found, const struct nearest_shape *near,
                     const struct world *world, vfloat *slope) {
    COUNT(normal_at, call);
    float id[LANES], step = (float)world->scene->model.march.normal_step;
    v_store(near->shape, id);
    struct vec gradient = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (unsigned lanes = v_mask_bits(found); lanes;) {
        ACTIVE(v_count(found));
        COUNT(normal_at, shape);
        int i = (int)id[__builtin_ctz(lanes)];
        vmask same = v_and(found, v_cmp_ge(v_splat(0.5f), v_abs(near->shape - v_splat((float)i))));
        gradient = vec_select(same, gradient_of(i, same, near->contact, step, world), gradient);
        lanes &= ~v_mask_bits(same);
    }
    ACTIVE(v_count(found));
    vmask away;
    return normal_of(gradient, direction, found, &away, slope);
}

// to − from, exact to an ulp of the difference.
static struct vec vec_between(struct point from, const double to[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(to[i], &hi[i], &lo[i]);
    return vec_scale(place_sub(from, hi, lo), v_splat(-1.0f));
}

// The light from the hits towards the camera: ambient, diffuse and specular.
static struct vec light_at(struct point p, struct vec n, struct vec direction, vmask found,
                           const struct materials *surface, const struct world *world) {
    COUNT(light_at, call);
    COUNT(light_at, scalar);
    vfloat zero = v_splat(0.0f);
    struct vec albedo = surface->color;
    struct vec to_light = vec_between(p, world->view->light_position);
    vfloat distance = vec_norm(to_light);
    to_light = vec_scale(to_light, v_splat(1.0f) / distance);
    vfloat cos_light = vec_dot(n, to_light);
    // No shadow ray where the surface faces away, because both terms are zero there, or where the light
    // lies on the surface and has no direction.
    vmask front = v_and(found, v_and(v_cmp_gt(cos_light, zero), v_cmp_gt(distance, zero)));
    struct vec color = vec_scale(albedo, v_splat(0.01f)); // ambient
    if (!v_any(front))
        return color;
    ACTIVE(v_count(front));
    COUNT(light_at, facing);
    vfloat attenuation = shadow(p, to_light, distance, front, world) / distance;
    ACTIVE(v_count(front));
    const double *e = world->view->light_emission;
    struct vec emission = {v_splat((float)e[0]), v_splat((float)e[1]), v_splat((float)e[2])};
    struct vec bright =
        lit_color(n, direction, to_light, cos_light, attenuation, surface, emission, color);
    return vec_select(front, bright, color);
}

void trace(struct point origin, struct vec direction, vmask active, int bounce,
           const struct world *world, struct shaded *result) {
    ACTIVE(v_count(active));
    COUNT(trace, call);
    const struct model *model = &world->scene->model;
    const double *b = model->background;
    struct vec background = {v_splat((float)b[0]), v_splat((float)b[1]), v_splat((float)b[2])};
    *result = (struct shaded){.color = background};
    ray_march(origin, direction, active, world, &result->hit);
    vmask found = result->hit.found;
    if (!v_any(found))
        return;
    ACTIVE(v_count(found));
    struct point p = result->hit.point;
    struct vec n = result->hit.normal;
    struct materials surface = materials_of(result->hit.shape, found, model);
    if (model->features.groups)
        surface = group_surfaces(result->hit.shape, found, world, surface);
    struct vec color = light_at(p, n, direction, found, &surface, world);
    ACTIVE(v_count(found));
    if (model->features.mirrors && bounce < model->march.max_bounces) {
        COUNT(trace, mirrors);
        // One ray on a mirror is enough for the call. The other lanes are inactive in it.
        vmask mirror = v_and(found, v_cmp_gt(surface.reflectivity, v_splat(0.0f)));
        if (v_any(mirror)) {
            ACTIVE(v_count(mirror));
            COUNT(trace, mirrored);
            struct point start =
                place_at(p, n, v_splat((float)model->march.surface_offset), v_splat(0.0f));
            struct shaded reflected;
            trace(start, vec_reflect(direction, n), mirror, bounce + 1, world, &reflected);
            vfloat share = v_select_or_zero(mirror, surface.reflectivity * v_splat(0.1f));
            color = vec_along(color, vec_select(mirror, reflected.color, color), share);
        }
    }
    ACTIVE(v_count(found));
    if (model->features.fog) {
        COUNT(trace, fog);
        vfloat far_sq = vec_dot(p.hi, p.hi);
        color = vec_scale(color, exp_of(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq)));
    }
    result->color = vec_select(found, color, background);
}
