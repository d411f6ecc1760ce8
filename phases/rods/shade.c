// What a hit looks like: normal, light (B. T. Phong, "Illumination for computer generated
// pictures", CACM 18 (1975)), mirror by recursion, fog.
#include "trace.h"

// Forward differences of the scene's distance, towards the side the ray comes from.
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
    if (!(length > 0.0)) { // no direction, as at a centre: towards the ray
        vec_scale(direction, -1.0, n);
        return;
    }
    COUNT(normal_at, direction);
    double sign = 1.0 - 2.0 * (vec_dot(direction, gradient) > 0.0);
    vec_scale(gradient, sign / length, n);
}

static void light_at(const double *p, const double *n, const double *direction,
                     const struct material *material, const struct world *world, double *color) {
    COUNT(light_at, call);
    const double *base = material->color, *emission = world->view->light_emission;
    vec_scale(base, 0.01, color); // ambient
    double to_light[3];
    vec_along(world->view->light_position, p, -1.0, to_light);
    double distance = vec_norm(to_light);
    if (!(distance > 0.0)) // the light lies on the surface: no direction to it
        return;
    COUNT(light_at, lit);
    vec_scale(to_light, 1.0 / distance, to_light);
    double facing = vec_dot(n, to_light);
    if (!(facing > 0.0)) // turned away: both terms are zero whatever the shadow
        return;
    COUNT(light_at, facing);
    double reach = shadow(p, to_light, distance, world->scene) / distance;
    double mirrored[3];
    vec_reflect(to_light, n, mirrored); // of the light's direction: minus the paper's R
    double shine = vec_dot(mirrored, direction);
    double specular =
        shine > 0.0 ? (COUNT(light_at, specular), 0.2 * pow(shine, material->shininess)) : 0.0;
    for (int i = 0; i < 3; i++)
        color[i] += emission[i] * (base[i] * facing + specular) * reach;
}

static void trace(const double *origin, const double *direction, int bounce,
                  const struct world *world, struct shaded *result) {
    COUNT(trace, call);
    ray_march(origin, direction, world->scene, &result->hit);
    shade(direction, bounce, world, result);
}

void shade(const double *direction, int bounce, const struct world *world, struct shaded *result) {
    COUNT(shade, call);
    const struct model *model = &world->scene->model;
    vec_set(model->background, result->color);
    vec_set((double[3]){0, 0, 0}, result->normal);
    if (!result->hit.found)
        return;
    COUNT(shade, hit);
    const double *p = result->hit.point;
    double *n = result->normal, *color = result->color;
    normal_at(p, direction, world->scene, n);
    const struct material *material = &model->materials[model->shapes[result->hit.shape].material];
    light_at(p, n, direction, material, world, color);
    if (material->reflectivity > 0.0 && bounce < model->march.max_bounces) {
        COUNT(shade, mirror);
        double start[3], mirrored[3];
        vec_along(p, n, model->march.surface_offset, start);
        vec_reflect(direction, n, mirrored);
        struct shaded seen;
        trace(start, mirrored, bounce + 1, world, &seen);
        vec_along(color, seen.color, material->reflectivity * 0.1, color);
    }
    if (model->features.fog) {
        COUNT(shade, fog);
        double far_sq = vec_norm_sq(p);
        vec_scale(color, exp(-model->fog * far_sq * sqrt(far_sq)), color);
    }
}
