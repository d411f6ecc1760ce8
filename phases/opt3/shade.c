// Shading of hits: normals, light (B. T. Phong, "Illumination for computer generated pictures",
// CACM 18 (1975)), mirrors by recursion, fog.
#include "trace.h"

// The surfaces with those of hits on groups in their lanes.
static struct materials group_surfaces(vdouble shape, struct vec p, vmask found,
                                       const struct prepared *scene, struct materials surface) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        vdouble index = v_splat(scene->primitives[i].index);
        vmask same = v_andnot(v_or(v_cmp_lt(shape, index), v_cmp_gt(shape, index)), found);
        if (scene->primitives[i].type != SHAPE_GROUP || !v_any(same))
            continue;
        struct materials mixed = group_surface(p, &scene->primitives[i], &scene->model);
        mix_materials(same, &mixed, &surface);
    }
    return surface;
}

// The unit normal by forward differences of the scene's distance, on the side of the incoming ray.
static struct vec normal_at(struct vec p, struct vec direction, vmask found,
                            const struct prepared *scene) {
    COUNT(normal_at, call);
    vdouble step = v_splat(scene->model.march.normal_step), nearest = v_splat(0.0);
    vmask done = v_not(found);
    vdouble values[4]; // at p, and moved along x, y, z
    for (int i = 0; i < 4; i++) {
        COUNT(normal_at, moved);
        struct vec moved = {p.x + (i == 1 ? step : v_splat(0.0)),
                            p.y + (i == 2 ? step : v_splat(0.0)),
                            p.z + (i == 3 ? step : v_splat(0.0))};
        values[i] = sdf(moved, scene, done, scene->model.features.groups, &nearest);
    }
    struct vec gradient = {values[1] - values[0], values[2] - values[0], values[3] - values[0]};
    vdouble length = vec_norm(gradient);
    vmask backfacing = v_cmp_gt(vec_dot(direction, gradient), v_splat(0.0));
    struct vec n = vec_scale(gradient, v_negate_where(backfacing, v_splat(1.0) / length));
    // Where the gradient vanishes, as at a centre, the normal points back along the ray.
    return vec_select(v_cmp_gt(length, v_splat(0.0)), n, vec_scale(direction, v_splat(-1.0)));
}

// The light from the hits towards the camera: ambient, diffuse and specular.
static struct vec light_at(struct vec p, struct vec n, struct vec direction, vmask found,
                           const struct materials *surface, const struct world *world) {
    COUNT(light_at, call);
    vdouble zero = v_splat(0.0);
    struct vec albedo = surface->color;
    struct vec to_light = vec_along(vec_set(world->view->light_position), p, v_splat(-1.0));
    vdouble distance = vec_norm(to_light);
    to_light = vec_scale(to_light, v_splat(1.0) / distance);
    vdouble cos_light = vec_dot(n, to_light);
    // No shadow ray where the surface faces away, because both terms are zero there, or where the light
    // lies on the surface and has no direction.
    vmask front = v_and(found, v_and(v_cmp_gt(cos_light, zero), v_cmp_gt(distance, zero)));
    struct vec color = vec_scale(albedo, v_splat(0.01)); // ambient
    if (!v_any(front))
        return color;
    ACTIVE(v_count(front));
    COUNT(light_at, facing);
    vdouble attenuation = shadow(p, to_light, distance, front, world->scene) / distance;
    ACTIVE(v_count(front));
    struct vec emission = vec_set(world->view->light_emission);
    struct vec bright =
        lit_color(n, direction, to_light, cos_light, attenuation, surface, emission, color);
    return vec_select(front, bright, color);
}

void trace(struct vec origin, struct vec direction, vmask active, int bounce,
           const struct world *world, struct shaded *result) {
    ACTIVE(v_count(active));
    COUNT(trace, call);
    const struct model *model = &world->scene->model;
    struct vec background = vec_set(model->background);
    *result = (struct shaded){.color = background};
    ray_march(origin, direction, active, world->scene, &result->hit);
    vmask found = result->hit.found;
    if (!v_any(found))
        return;
    ACTIVE(v_count(found));
    struct vec p = result->hit.point;
    struct vec n = normal_at(p, direction, found, world->scene);
    struct materials surface = materials_of(result->hit.shape, found, model);
    if (model->features.groups)
        surface = group_surfaces(result->hit.shape, p, found, world->scene, surface);
    struct vec color = light_at(p, n, direction, found, &surface, world);
    ACTIVE(v_count(found));
    if (model->features.mirrors && bounce < model->march.max_bounces) {
        COUNT(trace, mirrors);
        // One ray on a mirror is enough for the call. The other lanes are inactive in it.
        vmask mirror = v_and(found, v_cmp_gt(surface.reflectivity, v_splat(0.0)));
        if (v_any(mirror)) {
            ACTIVE(v_count(mirror));
            COUNT(trace, mirrored);
            struct vec start = vec_along(p, n, v_splat(model->march.surface_offset));
            struct shaded reflected;
            trace(start, vec_reflect(direction, n), mirror, bounce + 1, world, &reflected);
            vdouble share = v_select_or_zero(mirror, surface.reflectivity * v_splat(0.1));
            color = vec_along(color, vec_select(mirror, reflected.color, color), share);
        }
    }
    ACTIVE(v_count(found));
    if (model->features.fog) {
        COUNT(trace, fog);
        vdouble far_sq = vec_dot(p, p);
        color = vec_scale(color, exp_of(v_splat(-model->fog) * far_sq * v_sqrt(far_sq)));
    }
    result->color = vec_select(found, color, background);
    struct vec zero = {v_splat(0.0), v_splat(0.0), v_splat(0.0)};
    result->normal = vec_select(found, n, zero);
}
