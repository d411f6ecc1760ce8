// Shadow rays that need no march, by a cone query for each ray: in scenes of more than 256 solids.
#include "bvh/bvh_lists.h"
#include "shadow/shadow_cone.h"
#include "types/tile_context.h"

vmask bvh_trivially_lit(struct vec point, struct vec local, struct vec to_light, vfloat facing,
                        vfloat shape, vmask active, const struct tile_context *work) {
    const struct prepared *scene = work->scene;
    float q = scene->known.lit_slope;
    vmask clear = active;
    for (int k = 0; k < scene->plane_count; k++) {
        int i = scene->planes[k];
        vmask here =
            plane_clears(height_over(&scene->primitives[i], point),
                         vec_dot(vec_set(scene->primitives[i].normal), to_light), q, &scene->known);
        clear = v_and(clear, v_or(is_shape(shape, i), here));
    }
    float id[LANES];
    v_store(shape, id);
    for (unsigned rest = v_mask_bits(clear); rest;) { // once for each shape that rays start on
        int i = (int)id[__builtin_ctz(rest)];
        vmask same = v_and(v_mask_of_bits(rest), is_shape(shape, i));
        rest &= ~v_mask_bits(same);
        if (scene->primitives[i].eval != EVAL_LINEAR)
            clear = v_andnot(
                v_andnot(convex_from(&scene->primitives[i], local, facing, &scene->known), same),
                clear);
    }
    if (!v_any(clear) || q >= 0.99f)
        return v_mask_none();
    vfloat zero = v_splat(0.0f);
    struct packet_cones cones = {{point, to_light, v_splat(q), v_splat(1 - q * q), zero},
                                 zero,
                                 shape,
                                 v_splat(-1.0f),
                                 clear,
                                 v_mask_none()};
    bvh_cone_query(&scene->bvh, &cones, 1, &work->scratch->leaf);
    return v_and(clear, v_cmp_lt(cones.until, zero));
}
