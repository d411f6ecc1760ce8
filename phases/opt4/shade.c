// Shading of hits: normals, light (B. T. Phong, "Illumination for computer generated pictures",
// CACM 18 (1975)), mirrors by recursion, fog.
#include "trace.h"

// The surfaces with those of hits on groups in their lanes.
static struct surface group_surfaces(vfloat shape, vmask found, const struct world *world,
                                     struct surface surface) {
    for (int i = 0; i < world->scene->model.shape_count; i++) {
        const struct primitive *primitive = &world->scene->primitives[i];
        vfloat apart = v_abs(shape - v_splat(primitive->index));
        vmask same = v_and(found, v_cmp_lt(apart, v_splat(0.5f)));
        if (primitive->type != SHAPE_GROUP || !v_any(same))
            continue;
        struct surface mixed =
            group_surface(world->local_rays[i].origin, primitive, &world->scene->model);
        surface.color = vec_select(same, mixed.color, surface.color);
        surface.reflectivity = v_select(same, mixed.reflectivity, surface.reflectivity);
        surface.shininess = v_select(same, mixed.shininess, surface.shininess);
    }
    return surface;
}

// Precondition: the hits are the origins of world->local_rays.
static struct surface gather_surface(vfloat shape, vmask found, const struct world *world) {
    const struct model *model = &world->scene->model;
    float id[LANES], values[5][LANES];
    _mm256_storeu_ps(id, v_select(found, shape, v_splat(0.0f)));
    for (int lane = 0; lane < LANES; lane++) {
        const struct material *m = &model->materials[model->shapes[(int)id[lane]].material];
        for (int i = 0; i < 3; i++)
            values[i][lane] = (float)m->color[i];
        values[3][lane] = (float)m->reflectivity;
        values[4][lane] = (float)m->shininess;
    }
    struct surface surface = {
        {_mm256_loadu_ps(values[0]), _mm256_loadu_ps(values[1]), _mm256_loadu_ps(values[2])},
        _mm256_loadu_ps(values[3]),
        _mm256_loadu_ps(values[4])};
    return model->features.groups ? group_surfaces(shape, found, world, surface) : surface;
}

// Normals. By the scene's definition a normal is the forward difference of the scene's distance over
// normal_step. In float that difference has noise in its third digit: an ulp of the point over 1e-4.
// Three sources serve instead:
// - the closed-form gradient of the shape, where it agrees with the difference within that noise; of a group, the
//   central difference over more steps;
// - the difference of the shape's distance, elsewhere: within a step of an edge, on a Mandelbulb;
// - the difference of the scene's distance, where another shape is within reach of the step.
// The X_gradient functions work in the shape's axes. Their results need not be of unit length.
static struct vec box_gradient(struct vec p, const struct primitive *s) {
    COUNT(box_gradient, call);
    vfloat zero = v_splat(0.0f);
    vfloat x = v_abs(p.x) - v_splat(s->box.half_size[0]);
    vfloat y = v_abs(p.y) - v_splat(s->box.half_size[1]);
    vfloat z = v_abs(p.z) - v_splat(s->box.half_size[2]);
    vfloat most = v_max(x, v_max(y, z));
    // Outside, the gradient points away from the nearest point of the box. Inside, it follows the axis
    // of the nearest face.
    vmask outside = v_cmp_gt(most, zero), on_x = v_cmp_ge(x, most), on_y = v_cmp_ge(y, most);
    vfloat one = v_splat(1.0f);
    struct vec face = {v_select_or_zero(on_x, one), v_select_or_zero(v_andnot(on_x, on_y), one),
                       v_zero_where(v_or(on_x, on_y), one)};
    struct vec away = {v_max(x, zero), v_max(y, zero), v_max(z, zero)};
    struct vec g = vec_select(outside, away, face);
    return (struct vec){v_copysign(g.x, p.x), v_copysign(g.y, p.y), v_copysign(g.z, p.z)};
}

static struct vec torus_gradient(struct vec p, const struct primitive *s) {
    COUNT(torus_gradient, call);
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vfloat outward =
        v_splat(1.0f) - v_splat(s->torus.major_radius) / v_max(radius, v_splat(1e-30f));
    return (struct vec){p.x * outward, p.y, p.z * outward};
}

static struct vec cone_gradient(struct vec p, const struct primitive *s) {
    COUNT(cone_gradient, call);
    vfloat zero = v_splat(0.0f);
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vfloat x = radius - v_splat(s->cone.top_radius), y = p.y - v_splat(s->cone.half_height);
    vfloat rim =
        v_select(v_cmp_lt(p.y, zero), v_splat(s->cone.bottom_radius), v_splat(s->cone.top_radius));
    vfloat cap_x = v_max(radius - rim, zero), cap_y = v_abs(p.y) - v_splat(s->cone.half_height);
    vfloat across = v_madd(x, v_splat(s->cone.side[0]), y * v_splat(s->cone.side[1])) *
                    v_splat(-s->cone.inv_side_sq);
    vfloat along = v_min(v_max(across, zero), v_splat(1.0f));
    vfloat side_x = v_madd(v_splat(s->cone.side[0]), along, x);
    vfloat side_y = v_madd(v_splat(s->cone.side[1]), along, y);
    // Beside the side, its own normal: the vector to the nearest point is noise on the surface.
    vmask beside = v_and(v_cmp_gt(across, zero), v_cmp_lt(across, v_splat(1.0f)));
    vfloat out = v_select(beside, v_splat(s->cone.side[1]), side_x),
           up = v_select(beside, v_splat(-s->cone.side[0]), side_y);
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
    COUNT(octahedron_gradient, call);
    vfloat one = v_splat(1.0f);
    return (struct vec){v_copysign(one, p.x), v_copysign(one, p.y), v_copysign(one, p.z)};
}

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

// The shape's distance at the moved hit.
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
    case SHAPE_ROUNDED_BOX: exact = box_gradient(p, primitive); break;
    case SHAPE_TORUS: exact = torus_gradient(p, primitive); break;
    case SHAPE_CONE: exact = cone_gradient(p, primitive); break;
    case SHAPE_OCTAHEDRON: exact = octahedron_gradient(p); break;
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
    rounded = vec_scale(rounded, v_splat(1.0f / step));
    struct vec apart = vec_along(rounded, exact, v_splat(-1.0f));
    vfloat size = v_max(v_abs(p.x), v_max(v_abs(p.y), v_abs(p.z)));
    vfloat noise =
        v_madd(size, v_splat(0x1p-20f / step), v_splat(1e-3f)); // 16 half ulps, and curvature
    vmask edge =
        v_and(v_cmp_gt(vec_dot(apart, apart), noise * noise), v_cmp_lt(noise, v_splat(0.5f)));
    if (primitive->eval == LINEAR) // the plane's own difference is the closed form
        edge = v_and(edge, near);
    return vec_select(edge, rounded, exact);
}

// Evaluates one gradient for each shape that the packet hits.
struct vec normal_at(struct vec direction, vmask found, const struct nearest_shape *near,
                     const struct world *world, vfloat *slope) {
    COUNT(normal_at, call);
    float id[LANES], step = (float)world->scene->model.march.normal_step;
    _mm256_storeu_ps(id, near->shape);
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
    vfloat length = vec_norm(gradient);
    vfloat along = vec_dot(direction, gradient);
    *slope = v_select(v_cmp_lt(v_abs(length - v_splat(1.0f)), v_splat(1e-4f)), v_abs(along),
                      v_splat(1e30f));
    vmask backfacing = v_cmp_gt(along, v_splat(0.0f));
    struct vec n = vec_scale(gradient, v_negate_where(backfacing, v_splat(1.0f) / length));
    // Where the gradient vanishes, as at a centre, the normal points back along the ray. The square of
    // 1e-18 is still a normal float.
    vmask clear = v_and(v_cmp_gt(length, v_splat(1e-18f)), v_cmp_lt(length, v_splat(1e18f)));
    n = vec_select(clear, n, vec_scale(direction, v_splat(-1.0f)));
    return (struct vec){v_select_or_zero(found, n.x), v_select_or_zero(found, n.y),
                        v_select_or_zero(found, n.z)};
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
                           const struct surface *surface, const struct world *world) {
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
    vmask lit = v_and(found, v_and(v_cmp_gt(cos_light, zero), v_cmp_gt(distance, zero)));
    struct vec color = vec_scale(albedo, v_splat(0.01f)); // ambient
    if (!v_any(lit))
        return color;
    ACTIVE(v_count(lit));
    COUNT(light_at, lit);
    vfloat attenuation = shadow(p, to_light, distance, lit, world) / distance;
    ACTIVE(v_count(lit));
    // The reflection of the direction to the light, which is minus the paper's R.
    vfloat cos_mirror = vec_dot(vec_reflect(to_light, n), direction);
    vfloat specular =
        v_splat(0.2f) * power_of(v_max(cos_mirror, v_splat(1e-30f)), surface->shininess);
    specular = v_select_or_zero(v_cmp_gt(cos_mirror, zero), specular);
    const double *e = world->view->light_emission;
    struct vec emission = {v_splat((float)e[0]), v_splat((float)e[1]), v_splat((float)e[2])};
    struct vec lit_color = {
        v_madd(emission.x * v_madd(albedo.x, cos_light, specular), attenuation, color.x),
        v_madd(emission.y * v_madd(albedo.y, cos_light, specular), attenuation, color.y),
        v_madd(emission.z * v_madd(albedo.z, cos_light, specular), attenuation, color.z)};
    return vec_select(lit, lit_color, color);
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
    struct surface surface = gather_surface(result->hit.shape, found, world);
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
