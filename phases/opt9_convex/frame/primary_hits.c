// Shades camera rays in scenes without secondary rays. The normal was computed when the ray hit the shape.
#include "frame/lighting.h"
#include "hit/scene_bounds.h"

// Sets the material of the lanes that hit shape i.
INLINE void material_of(int i, const struct primary_hit *seen, const struct prepared *scene,
                        struct surface *all) {
    const struct primitive *s = &KNOWN(scene)->primitives[i];
    vmask same = is_shape(seen->hit.shape, i);
    all->color = vec_select(same, vec_set(s->color), all->color);
    all->shininess = v_select(same, v_splat(s->shininess), all->shininess);
    all->shine_from = v_select(same, v_splat(s->shine_from), all->shine_from);
}

// Sets the material of shape i in all lanes, if all of them hit it.
INLINE void sole_material(int i, const struct primary_hit *seen, const struct prepared *scene,
                          struct surface *all) {
    const struct primitive *s = &KNOWN(scene)->primitives[i];
    if (i != seen->only && !ONE_MATERIAL)
        return;
    all->color = vec_set(s->color);
    all->shininess = v_splat(s->shininess);
    all->shine_from = v_splat(s->shine_from);
}

static inline void primary_material(const struct primary_hit *seen, const struct prepared *scene,
                                    struct surface *all) {
    if (ONE_MATERIAL) {
        sole_material(0, seen, scene, all);
        return;
    }
    if (seen->only >= 0) {
        UNROLL_SHAPES
        for (int i = 0; i < KNOWN(scene)->model.shape_count; i++)
            sole_material(i, seen, scene, all);
        return;
    }
    struct vec none = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    all->color = none;
    all->shininess = all->shine_from = v_splat(0.0f);
    unsigned left = v_mask_bits(seen->hit.found);
    UNROLL_SHAPES
    for (int k = 0; hits_left(left, k); k++)
        material_of(next_hit_shape(&left, seen->hit.shape, k), seen, scene, all);
}

KERNEL_SHARED void shade_primary_hit(const struct primary_hit *seen, struct shading_packet *at,
                                     const struct tile_context *work) {
    const struct known_scene *scene = KNOWN(work->scene);
    at->hit.found = seen->hit.found;
    at->hit.t = seen->hit.t;
    at->hit.shape = seen->hit.shape;
    vmask far = v_and(at->hit.found, v_cmp_gt(at->hit.t, v_splat(work->inside)));
    if (scene->model.features.fog || v_any(far)) {
        at->point = vec_along(at->ray.origin, at->ray.direction, at->hit.t);
        if (v_any(far))
            at->hit.found = v_and(at->hit.found, in_bounds(at, scene));
    }
    at->color = background(v_splat(1.0f), &scene->model);
    if (!v_any(at->hit.found))
        return;
    at->surface.normal = seen->hit.local;
    primary_material(seen, work->scene, &at->surface);
    primary_light(at, &at->surface, work);
    at->color.x = at->color.x + v_select_or_zero(at->front, at->light.x);
    at->color.y = at->color.y + v_select_or_zero(at->front, at->light.y);
    at->color.z = at->color.z + v_select_or_zero(at->front, at->light.z);
}
