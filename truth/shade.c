// Shading in doubles from enclosed points and normals: light (B. T. Phong, "Illumination for computer generated
// pictures", CACM 18 (1975)), mirrors by recursion, fog.
#include "trace.h"

static double dot3(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Computes the reflected light for each kind of shadow; n is the unit normal, `direction` the ray's.
static void light_at(const struct prepared *prepared, const struct view *view,
                     const struct hit *hit, const double n[3], const double direction[3],
                     struct shaded *result) {
    const struct material *material = &hit->material;
    double to_light[3];
    for (int i = 0; i < 3; i++) {
        // In quad, so that nothing cancels.
        to_light[i] = (double)((quad)view->light_position[i] - mid_q(hit->point[i]));
        for (int kind = 0; kind < SHADOW_KINDS; kind++)
            result->color[kind][i] = material->color[i] * 0.01;
    }
    double distance = sqrt(dot3(to_light, to_light));
    if (!(distance > 0.0)) // the light lies on the surface: no direction to it
        return;
    for (int i = 0; i < 3; i++)
        to_light[i] /= distance;
    enum status sure = find_shadow(prepared, hit, view, result->shadow);
    result->status_all = sure < result->status_all ? sure : result->status_all;
    double facing = dot3(n, to_light), mirrored[3], shine = 0;
    if (!(facing > 0.0))
        return;
    for (int i = 0; i < 3; i++)
        mirrored[i] = 2.0 * facing * n[i] - to_light[i];
    shine = fmax(-dot3(mirrored, direction), 0.0);
    double specular = 0.2 * pow(shine, material->shininess);
    for (int kind = 0; kind < SHADOW_KINDS; kind++)
        for (int i = 0; i < 3; i++)
            result->color[kind][i] += view->light_emission[i] *
                                      (material->color[i] * facing + specular) *
                                      (result->shadow[kind] / distance);
}

// The reflected ray as intervals, from the enclosed point into the enclosed direction.
static void mirror(const struct prepared *prepared, const struct ray_q *ray, const struct hit *hit,
                   struct ray_q *out) {
    struct ivq offset = point_q(prepared->model.march.surface_offset);
    struct ivq along = dot_q(ray->d, hit->normal);
    along = add_q(along, along);
    for (int i = 0; i < 3; i++) {
        out->o[i] = add_q(hit->point[i], mul_q(offset, hit->normal[i]));
        out->d[i] = sub_q(ray->d[i], mul_q(along, hit->normal[i]));
    }
}

void trace(const struct prepared *prepared, const struct view *view, const struct ray_q *ray,
           int bounce, struct shaded *result) {
    const struct model *model = &prepared->model;
    *result = (struct shaded){.shadow = {1, 1, 1}};
    struct hit *hit = &result->hit;
    find_hit(prepared, ray, hit);
    result->status_all = hit->status;
    if (hit->shape < 0) {
        for (int kind = 0; kind < SHADOW_KINDS; kind++)
            for (int i = 0; i < 3; i++)
                result->color[kind][i] = model->background[i];
        return;
    }
    find_normal(prepared, ray, hit);
    double n[3], direction[3], far[3];
    for (int i = 0; i < 3; i++) {
        n[i] = (double)mid_q(hit->normal[i]);
        direction[i] = (double)mid_q(ray->d[i]);
        far[i] = (double)mid_q(hit->point[i]);
    }
    double length = sqrt(dot3(direction, direction));
    for (int i = 0; i < 3; i++)
        direction[i] /= length;
    if (!hit->normal_sure)
        result->status_all = UNDECIDED;
    light_at(prepared, view, hit, n, direction, result);
    double reflectivity = hit->material.reflectivity;
    if (reflectivity > 0.0 && bounce < model->march.max_bounces) {
        struct ray_q next;
        struct shaded mirrored;
        mirror(prepared, ray, hit, &next);
        trace(prepared, view, &next, bounce + 1, &mirrored);
        result->status_all =
            mirrored.status_all < result->status_all ? mirrored.status_all : result->status_all;
        for (int kind = 0; kind < SHADOW_KINDS; kind++)
            for (int i = 0; i < 3; i++)
                result->color[kind][i] += mirrored.color[kind][i] * (reflectivity * 0.1);
    }
    double distance = sqrt(dot3(far, far));
    double clear = exp(-model->fog * distance * distance * distance);
    for (int kind = 0; kind < SHADOW_KINDS; kind++)
        for (int i = 0; i < 3; i++)
            result->color[kind][i] *= clear;
}
