// Shading of hits: normals, light (B. T. Phong, "Illumination for computer generated pictures",
// CACM 18 (1975)), mirrors by recursion, fog.
#include "trace.h"

// The unit normal by forward differences of the scene's distance, on the side of the incoming ray.
static void normal_at(const double *p, const double *direction, const struct prepared *scene,
                      double *n) {
    COUNT(normal_at, call);
    int nearest;
    double here = sdf(p, scene, &nearest), gradient[3];
    for (int i = 0; i < 3; i++) {
        double moved[3] = {p[0], p[1], p[2]};
        moved[i] += scene->model.march.normal_step;
        gradient[i] = sdf(moved, scene, &nearest) - here;
    }
    double length = vec_norm(gradient);
    if (!(length > 0.0)) { // no gradient, as at a centre: back along the ray
        vec_scale(direction, -1.0, n);
        return;
    }
    COUNT(normal_at, direction);
    double sign = 1.0 - 2.0 * (vec_dot(direction, gradient) > 0.0);
    vec_scale(gradient, sign / length, n);
}

// The light from the hit towards the camera: ambient, diffuse and specular.
static void light_at(const double *p, const double *n, const double *direction,
                     const struct material *material, const struct world *world, double *color) {
    COUNT(light_at, call);
    const double *albedo = material->color, *emission = world->view->light_emission;
    vec_scale(albedo, 0.01, color); // ambient
    double to_light[3];
    vec_along(world->view->light_position, p, -1.0, to_light);
    double distance = vec_norm(to_light);
    if (!(distance > 0.0)) // the light lies on the surface and has no direction
        return;
    COUNT(light_at, direction);
    vec_scale(to_light, 1.0 / distance, to_light);
    double cos_light = vec_dot(n, to_light);
    if (!(cos_light > 0.0)) // facing away: both terms are zero, so no shadow ray
        return;
    COUNT(light_at, facing);
    double attenuation = shadow(p, to_light, distance, world->scene) / distance;
    double mirrored[3];
    vec_reflect(to_light, n, mirrored); // minus the paper's R
    double cos_mirror = vec_dot(mirrored, direction);
    double specular = cos_mirror > 0.0
                          ? (COUNT(light_at, specular), 0.2 * pow(cos_mirror, material->shininess))
                          : 0.0;
    for (int i = 0; i < 3; i++)
        color[i] += emission[i] * (albedo[i] * cos_light + specular) * attenuation;
}

void trace(const double *origin, const double *direction, int bounce, const struct world *world,
           struct shaded *result) {
    COUNT(trace, call);
    *result = (struct shaded){.color = {0}};
    ray_march(origin, direction, world->scene, &result->hit);
    shade(direction, bounce, world, result);
}

void shade(const double *direction, int bounce, const struct world *world, struct shaded *result) {
    const struct model *model = &world->scene->model;
    vec_set(model->background, result->color);
    if (!result->hit.found)
        return;
    COUNT(trace, hit);
    const double *p = result->hit.point;
    double *n = result->normal, *color = result->color;
    normal_at(p, direction, world->scene, n);
    const struct shape *shape = &model->shapes[result->hit.shape];
    const struct material *material = &model->materials[shape->material];
    struct material mixed;
    if (shape->type == SHAPE_GROUP) {
        group_surface(p, &world->scene->primitives[result->hit.shape], model, &mixed);
        material = &mixed;
    }
    light_at(p, n, direction, material, world, color);
    if (material->reflectivity > 0.0 && bounce < model->march.max_bounces) {
        COUNT(trace, mirror);
        double start[3], reflected_direction[3];
        vec_along(p, n, model->march.surface_offset, start);
        vec_reflect(direction, n, reflected_direction);
        struct shaded reflected;
        trace(start, reflected_direction, bounce + 1, world, &reflected);
        vec_along(color, reflected.color, material->reflectivity * 0.1, color);
    }
    if (model->features.fog) {
        COUNT(trace, fog);
        double far_sq = vec_norm_sq(p);
        vec_scale(color, exp(-model->fog * far_sq * sqrt(far_sq)), color);
    }
}
