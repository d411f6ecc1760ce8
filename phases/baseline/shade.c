// Shading of hits: normals, light (B. T. Phong, "Illumination for computer generated pictures",
// CACM 18 (1975)), mirrors by recursion, fog.
#include "trace.h"

// The unit normal by forward differences of the scene's distance, on the side of the incoming ray.
static struct vec3 normal_at(struct vec3 p, struct vec3 direction, struct world world) {
    COUNT(normal_at, call);
    int nearest;
    double step = world.model->march.normal_step;
    double here = sdf(p, world, &nearest);
    struct vec3 n = new_vector(sdf(vec_add(p, new_vector(step, 0, 0)), world, &nearest) - here,
                               sdf(vec_add(p, new_vector(0, step, 0)), world, &nearest) - here,
                               sdf(vec_add(p, new_vector(0, 0, step)), world, &nearest) - here);
    if (!(vec_norm(n) > 0.0)) // no gradient, as at a centre: back along the ray
        return vec_scale(direction, -1.0);
    n = vec_normalize(n);
    return vec_dot(direction, n) > 0.0 ? vec_scale(n, -1.0) : n;
}

// The light from the hit towards the camera: ambient, diffuse and specular.
static struct vec3 light_at(struct vec3 p, struct vec3 n, struct vec3 direction,
                            struct material material, struct world world) {
    COUNT(light_at, call);
    struct vec3 color = *vec_at(material.color);
    struct vec3 ambient = vec_scale(color, 0.01);
    struct vec3 to_light = vec_sub(*vec_at(world.view->light_position), p);
    double distance = vec_norm(to_light);
    if (!(distance > 0.0)) // the light lies on the surface and has no direction
        return ambient;
    COUNT(light_at, direction);
    to_light = vec_scale(to_light, 1.0 / distance);
    double attenuation = shadow(p, to_light, distance, world) / distance;
    double cos_light = vec_dot(n, to_light);
    struct vec3 emission = *vec_at(world.view->light_emission);
    struct vec3 diffuse = vec_scale(vec_mult(emission, color), fmax(cos_light, 0.0) * attenuation);
    struct vec3 specular = new_vector(0, 0, 0);
    if (cos_light > 0.0) {
        COUNT(light_at, specular);
        struct vec3 mirrored = vec_reflect(vec_scale(to_light, -1.0), n);
        double cos_mirror = fmax(vec_dot(mirrored, vec_scale(direction, -1.0)), 0.0);
        specular = vec_scale(emission, 0.2 * pow(cos_mirror, material.shininess) * attenuation);
    }
    return vec_add(vec_add(ambient, diffuse), specular);
}

static struct material material_at(struct vec3 p, int index, struct world world) {
    const struct shape *shape = &world.shapes[index];
    return shape->type == SHAPE_GROUP ? group_material(p, shape, world.model)
                                      : world.model->materials[shape->material];
}

struct shaded trace(struct vec3 origin, struct vec3 direction, int bounce, struct world world) {
    COUNT(trace, call);
    struct shaded result = {.color = *vec_at(world.model->background)};
    result.hit = ray_march(origin, direction, world);
    if (!result.hit.found)
        return result;
    COUNT(trace, hit);
    struct vec3 p = result.hit.point;
    struct vec3 n = normal_at(p, direction, world);
    struct material material = material_at(p, result.hit.shape, world);
    struct vec3 color = light_at(p, n, direction, material, world);
    if (material.reflectivity > 0.0 && bounce < world.model->march.max_bounces) {
        COUNT(trace, mirror);
        struct vec3 start = vec_add(p, vec_scale(n, world.model->march.surface_offset));
        struct shaded reflected = trace(start, vec_reflect(direction, n), bounce + 1, world);
        color = vec_add(color, vec_scale(reflected.color, material.reflectivity * 0.1));
    }
    double far = vec_norm(p);
    result.color = vec_scale(color, exp(-world.model->fog * far * far * far));
    result.normal = n;
    return result;
}
