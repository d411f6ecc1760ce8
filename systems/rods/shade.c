// Shading: normal, light (B. T. Phong, "Illumination for computer generated pictures", CACM 18 (1975)), mirrors by
// recursion, fog.
#include "trace.h"

double scene_distance(const double *p, const struct prepared *scene, int *nearest) {
    return sdf(p, scene, nearest);
}

// The normal by forward differences of the scene's distance, on the side that the ray comes from.
static void normal_at(const double *p, const double *direction, const struct prepared *scene,
                      double *n) {
    int nearest;
    double here = scene_distance(p, scene, &nearest), gradient[3];
    for (int i = 0; i < 3; i++) {
        double moved[3] = {p[0], p[1], p[2]};
        moved[i] += scene->model.march.normal_step;
        gradient[i] = scene_distance(moved, scene, &nearest) - here;
    }
    double length = vec_norm(gradient);
    if (!(length > 0.0)) { // no gradient, as at a centre: against the ray
        vec_scale(direction, -1.0, n);
        return;
    }
    double sign = 1.0 - 2.0 * (vec_dot(direction, gradient) > 0.0);
    vec_scale(gradient, sign / length, n);
}

// Adds ambient, diffuse and specular light of the hit at p to the colour; n is its normal.
static void light_at(const double *p, const double *n, const double *direction,
                     const struct material *material, const struct scene_view *input,
                     double *color) {
    const double *albedo = material->color, *emission = input->view->light_emission;
    vec_scale(albedo, 0.01, color); // ambient
    double to_light[3];
    vec_along(input->view->light_position, p, -1.0, to_light);
    double distance = vec_norm(to_light);
    if (!(distance > 0.0)) // the light lies on the surface: no direction to it
        return;
    vec_scale(to_light, 1.0 / distance, to_light);
    double cos_light = vec_dot(n, to_light);
    if (!(cos_light > 0.0)) // rotated away: both terms are zero whatever the shadow
        return;
    double attenuation = shadow(p, to_light, distance, input->scene) / distance;
    double mirrored[3];
    vec_reflect(to_light, n, mirrored); // minus the paper's R
    double cos_mirror = vec_dot(mirrored, direction);
    double specular = cos_mirror > 0.0 ? 0.2 * pow(cos_mirror, material->shininess) : 0.0;
    for (int i = 0; i < 3; i++)
        color[i] += emission[i] * (albedo[i] * cos_light + specular) * attenuation;
}

static void trace(const double *origin, const double *direction, int bounce,
                  const struct scene_view *input, struct shaded *result) {
    ray_march(origin, direction, input->scene, &result->hit);
    shade(direction, bounce, input, result);
}

void shade(const double *direction, int bounce, const struct scene_view *input,
           struct shaded *result) {
    const struct model *model = &input->scene->model;
    vec_set(model->background, result->color);
    vec_set((double[3]){0, 0, 0}, result->normal);
    if (!result->hit.found)
        return;
    const double *p = result->hit.point;
    double *n = result->normal, *color = result->color;
    normal_at(p, direction, input->scene, n);
    const struct material *material = &model->materials[model->shapes[result->hit.shape].material];
    light_at(p, n, direction, material, input, color);
    if (material->reflectivity > 0.0 && bounce < model->march.max_bounces) {
        double start[3], reflected_direction[3];
        vec_along(p, n, model->march.surface_offset, start);
        vec_reflect(direction, n, reflected_direction);
        struct shaded reflected;
        trace(start, reflected_direction, bounce + 1, input, &reflected);
        vec_along(color, reflected.color, material->reflectivity * 0.1, color);
    }
    if (model->features.fog) {
        double far_sq = vec_norm_sq(p);
        vec_scale(color, exp(-model->fog * far_sq * sqrt(far_sq)), color);
    }
}
