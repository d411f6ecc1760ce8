// Shadow rays that need no march: no shape brings their light below 1, but for their own at the start (PROOFS.md).
#include "hit/sharp.h"
#include "repetition/repeated_rays.h"
#include "shadow/shadow_cone.h"
#include "types/ideal.h"
#include "types/tile_context.h"

// Returns q: a ray that no shape comes nearer to than q·t is lit. Ideal: by the ratio itself, with a margin for rounding.
INLINE float lit_cone(const struct known_scene *scene) {
    return SOFT_IS_IDEAL ? (float)((1 + 1e-5) / scene->model.shadow_strength) : scene->lit_slope;
}

// Returns the rays about which a cone of slope q misses all parts of a sharp group (PROOFS.md, 15.).
INLINE vmask cone_misses_parts(const struct primitive *s, struct vec point, struct vec l, float q) {
    const struct sharp *sharp = SHARP_OF(s);
    vmask clear = sharp && sharp->balls > 0 ? v_mask_all() : v_mask_none();
    for (int k = 0; sharp && k < sharp->balls; k++) {
        const float *ball = sharp->ball[k];
        struct vec v = vec_sub(vec_set(ball), point);
        clear = v_and(clear, cone_misses(cone_to_ball(v, l, ball[3], ball[3] * ball[3], q), q));
    }
    return clear;
}

// Removes from *clear the rays that shape i may darken.
INLINE void shape_trivially_lit(int i, struct vec point, struct vec local, struct vec to_light,
                                vfloat facing, vfloat shape, const struct tile_context *work,
                                vmask *clear) {
    if (!v_any(*clear))
        return;
    const struct known_scene *scene = KNOWN(work->scene);
    const struct primitive *s = &scene->primitives[i];
    float q = lit_cone(scene);
    vmask here;
    if (s->eval == EVAL_LINEAR) {
        here = v_or(is_shape(shape, i),
                    plane_clears(height_over(s, point), add_dot(s->normal, to_light), q, scene));
    } else {
        ACTIVE(v_count(*clear));
        COUNT(cone_test, call);
        float slope = lit_slope_for(s, q);
        if (SOFT_IS_IDEAL && s->type == SHAPE_MANDELBULB && q < share_of(s))
            slope = q / share_of(s);
        struct vec to = to_centre(s, point);
        here = cone_misses(shadow_cone_to(to, to_light, s, slope), slope);
        if (IS_GROUP(s) && v_any(v_andnot(here, *clear)))
            here = v_or(here, cone_misses_parts(s, point, to_light, slope));
        if (!SOFT_IS_IDEAL && s->type != SHAPE_SPHERE && s->type != SHAPE_MANDELBULB &&
            !IS_GROUP(s) && v_any(v_andnot(here, *clear)))
            here = v_or(here, plane_between(to, to_light, s, q));
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
