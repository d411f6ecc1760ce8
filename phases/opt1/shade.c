// Shading of hits: normals, light (B. T. Phong, "Illumination for computer generated pictures",
// CACM 18 (1975)), mirrors by recursion, fog.
#include "trace.h"

// The unit normal by forward differences of the scene's distance, on the side of the incoming ray.
static void normal_at(const struct vec3 *p, const struct vec3 *direction,
                      const struct prepared *scene, struct vec3 *n) {
    COUNT(normal_at, call);
    int nearest;
    double step = scene->model.march.normal_step;
    double here = sdf(p, scene, &nearest);
    struct vec3 px = {p->x + step, p->y, p->z};
    struct vec3 py = {p->x, p->y + step, p->z};
    struct vec3 pz = {p->x, p->y, p->z + step};
    struct vec3 gradient = {sdf(&px, scene, &nearest) - here, sdf(&py, scene, &nearest) - here,
                            sdf(&pz, scene, &nearest) - here};
    if (!(vec_norm(&gradient) > 0.0)) { // no gradient, as at a centre: back along the ray
        vec_scale(direction, -1.0, n);
        return;
    }
    vec_normalize(&gradient, n);
    if (vec_dot(direction, n) > 0.0)
        vec_scale(n, -1.0, n);
}

// The light from the hit towards the camera: ambient, diffuse and specular.
static void light_at(const struct vec3 *p, const struct vec3 *n, const struct vec3 *direction,
                     const struct material *material, const struct world *world,
                     struct vec3 *color) {
    COUNT(light_at, call);
    struct vec3 albedo = {material->color[0], material->color[1], material->color[2]};
    const double *light = world->view->light_position;
    struct vec3 to_light = {light[0] - p->x, light[1] - p->y, light[2] - p->z};
    double distance = vec_norm(&to_light);
    vec_scale(&albedo, 0.01, color); // ambient
    if (!(distance > 0.0))           // the light lies on the surface and has no direction
        return;
    COUNT(light_at, direction);
    vec_scale(&to_light, 1.0 / distance, &to_light);
    double attenuation = shadow(p, &to_light, distance, world->scene) / distance;
    double cos_light = vec_dot(n, &to_light);
    const double *e = world->view->light_emission;
    struct vec3 emission = {e[0], e[1], e[2]}, diffuse;
    vec_mult(&emission, &albedo, &diffuse);
    vec_scale(&diffuse, fmax(cos_light, 0.0) * attenuation, &diffuse);
    vec_add(color, &diffuse, color);
    if (cos_light > 0.0) {
        COUNT(light_at, specular);
        struct vec3 from_light, mirrored, specular;
        vec_scale(&to_light, -1.0, &from_light);
        vec_reflect(&from_light, n, &mirrored);
        double cos_mirror = fmax(-vec_dot(&mirrored, direction), 0.0);
        vec_scale(&emission, 0.2 * pow(cos_mirror, material->shininess) * attenuation, &specular);
        vec_add(color, &specular, color);
    }
}

void trace(const struct vec3 *origin, const struct vec3 *direction, int bounce,
           const struct world *world, struct shaded *result) {
    COUNT(trace, call);
    const struct model *model = &world->scene->model;
    const double *b = model->background;
    *result = (struct shaded){.color = {b[0], b[1], b[2]}};
    ray_march(origin, direction, world->scene, &result->hit);
    if (!result->hit.found)
        return;
    COUNT(trace, hit);
    const struct vec3 *p = &result->hit.point;
    struct vec3 *n = &result->normal, *color = &result->color;
    normal_at(p, direction, world->scene, n);
    struct material material =
        material_at(p, &world->scene->primitives[result->hit.shape], model->materials);
    light_at(p, n, direction, &material, world, color);
    if (material.reflectivity > 0.0 && bounce < model->march.max_bounces) {
        COUNT(trace, mirror);
        struct vec3 start, reflected_direction;
        vec_along(p, n, model->march.surface_offset, &start);
        vec_reflect(direction, n, &reflected_direction);
        struct shaded reflected;
        trace(&start, &reflected_direction, bounce + 1, world, &reflected);
        vec_along(color, &reflected.color, material.reflectivity * 0.1, color);
    }
    if (model->features.fog) {
        COUNT(trace, fog);
        double far = vec_norm(p);
        vec_scale(color, exp(-model->fog * far * far * far), color);
    }
}
