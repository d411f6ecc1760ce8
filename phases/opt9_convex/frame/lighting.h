// Light at a packet's hits (B. T. Phong, "Illumination for computer generated pictures", CACM 18 (1975)), as in
// fallback/shade.c: for any rays, and a shorter form for camera rays.
#pragma once

#include "simd/simd.h"
#include "types/sdf.h"
#include "types/shading_packet.h"
#include "types/tile_context.h"

// Returns a to the power of the shininess. A whole number that is known needs only products.
static inline vfloat phong_power(vfloat a, vfloat shininess) {
    if (!WHOLE_SHININESS)
        return v_pow(a, shininess);
    vfloat power = v_splat(1.0f);
    for (int rest = WHOLE_SHININESS; rest; rest >>= 1, a = a * a)
        if (rest & 1)
            power = power * a;
    return power;
}

// Sets at->light. shine: cosine between the direction back to the ray's origin and the mirrored light. reach:
// the ray's weight over the distance to the light.
INLINE void add_phong(struct shading_packet *at, const struct surface *surface, vfloat shine,
                      vfloat reach, const struct tile_context *work) {
    vfloat specular = v_splat(0.0f);
    const float *e = work->emission;
    vmask shines = v_and(at->front, v_cmp_gt(shine, surface->shine_from));
    if (v_any(shines)) {
        specular = v_select_or_zero(
            shines, v_splat(0.2f) * phong_power(v_max(shine, v_splat(1e-30f)), surface->shininess));
    }
    struct vec base = surface->color;
    at->light = (struct vec){v_splat(e[0]) * v_madd(base.x, at->facing, specular) * reach,
                             v_splat(e[1]) * v_madd(base.y, at->facing, specular) * reach,
                             v_splat(e[2]) * v_madd(base.z, at->facing, specular) * reach};
}

// Sets colour (ambient), front, facing, to_light and light of a packet. axis: the normal if all hits are on one
// plane (a kernel knows it), else NULL.
INLINE void light_surfaces(struct shading_packet *at, const struct surface *surface,
                           const float *axis, const struct tile_context *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    const struct packet_ray *ray = &at->ray;
    struct vec p = at->point, n = surface->normal, base = surface->color;
    vfloat weight = ray->weight, zero = v_splat(0.0f);
    if (model->features.fog) {
        vfloat far_sq = vec_dot(p, p);
        weight = weight * v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq));
    }
    at->weight = weight;
    at->color = vec_select(at->hit.found, vec_scale(base, weight * v_splat(0.01f)),
                           background(ray->weight, model)); // ambient
    const float *light = work->light;
    struct vec l = vec_sub(vec_set(light), p);
    vfloat square = vec_dot(l, l), per = v_splat(1.0f) / v_sqrt(square);
    l = vec_scale(l, per);
    vfloat facing = axis ? add_dot(axis, l) : vec_dot(n, l);
    at->front = v_and(at->hit.found, v_and(v_cmp_gt(facing, zero), v_cmp_gt(square, zero)));
    at->facing = facing;
    at->to_light = l;
    vfloat shine = vec_dot(axis ? reflected_at(axis, l) : vec_reflect(l, n), ray->direction);
    add_phong(at, surface, shine, weight * per, work);
}

// As light_surfaces() for camera rays: the vector to the light is derived from light_from_eye and kept
// unnormalised.
INLINE void primary_light(struct shading_packet *at, const struct surface *surface,
                          const struct tile_context *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    struct vec d = at->ray.direction, n = surface->normal;
    vfloat weight = v_splat(1.0f), zero = v_splat(0.0f), t = at->hit.t;
    if (model->features.fog) {
        vfloat far_sq = vec_dot(at->point, at->point);
        weight = v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq));
    }
    at->color = vec_select(at->hit.found, vec_scale(surface->color, weight * v_splat(0.01f)),
                           background(v_splat(1.0f), model));
    const float *lamp = work->light_from_eye;
    struct vec l = {v_nmadd(d.x, t, v_splat(lamp[0])), v_nmadd(d.y, t, v_splat(lamp[1])),
                    v_nmadd(d.z, t, v_splat(lamp[2]))};
    vfloat square = vec_dot(l, l), per = v_splat(1.0f) / v_sqrt(square), along = vec_dot(n, l);
    vfloat down = vec_dot(n, d), shine = v_nmadd(along + along, down, vec_dot(l, d));
    along = v_negate_where(v_cmp_gt(down, zero), along); // n may point away from the ray
    at->facing = along * per;
    at->front = v_and(at->hit.found, v_and(v_cmp_gt(along, zero), v_cmp_gt(square, zero)));
    add_phong(at, surface, shine * per, weight * per, work);
}
