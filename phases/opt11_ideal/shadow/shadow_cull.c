// Shadow rays that no shape but their own can darken, and that one's shadow. The ratio of a convex solid on which
// a ray starts is least at the start (PROOFS.md, 5.).
#include "repetition/repeated_rays.h"
#include "shadow/own_solid.h"
#include "shadow/shadow_cone.h"
#include "types/tile_context.h"

// Rays whose ratio is nowhere below this are lit. The margin is for rounding.
static inline float lit_ratio(const struct known_scene *scene) {
    return (float)((1 + 1e-5) / scene->model.shadow_strength);
}

// Removes from *clear the rays that shape i may darken.
INLINE void shape_trivially_lit(int i, struct vec point, struct vec local, struct vec to_light,
                                vfloat facing, vfloat shape, const struct tile_context *work,
                                vmask *clear) {
    if (!v_any(*clear))
        return;
    const struct known_scene *scene = KNOWN(work->scene);
    const struct primitive *s = &scene->primitives[i];
    float q = lit_ratio(scene);
    vmask here;
    if (s->eval == EVAL_LINEAR) {
        here = v_or(is_shape(shape, i),
                    plane_clears(height_over(s, point), add_dot(s->normal, to_light), q, scene));
    } else {
        float slope = q / share_of(s);
        slope = slope < 1.0f ? slope : 1.0f; // a cone of slope 1 meets all
        struct vec to = to_centre(s, point);
        here = cone_misses(shadow_cone_to(to, to_light, s, slope), slope);
        if (v_any(v_andnot(here, *clear)))
            here = v_or(here, v_and(is_shape(shape, i), convex_from(s, local, facing, scene)));
    }
    *clear = v_and(*clear, here);
}

vmask trivially_lit(const struct vec *point, const struct vec *local, const struct vec *to_light,
                    vfloat facing, vfloat shape, vmask active, const struct tile_context *work) {
    vmask clear = REPEATS(work->scene) ? v_mask_none() : active; // a copy may be anywhere
    UNROLL_SHAPES
    for (int k = 0; k < set_end(&work->scratch->occluders); k++)
        if (set_has(&work->scratch->occluders, k))
            shape_trivially_lit(set_shape(&work->scratch->occluders, k), *point, *local, *to_light,
                                facing, shape, work, &clear);
    return clear;
}

vfloat self_shadow(const struct primitive *s, struct vec local, struct vec to_light, vfloat facing,
                   const struct prepared *scene) {
    vfloat strength = v_splat((float)KNOWN(scene)->model.shadow_strength), ratio = facing;
    vfloat offset = v_splat((float)KNOWN(scene)->model.march.surface_offset);
    if (s->eval != EVAL_LINEAR)
        ratio = own_ratio(s, local, turned(s, to_light), offset);
    return v_min(v_splat(1.0f), strength * ratio);
}
