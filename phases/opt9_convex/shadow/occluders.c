// Which shapes can darken the shadow rays of a group of packets. The quadratic a·t² − 2·b·t + c of a cone and a
// sphere: see struct shadow_cone.
#include "bulb/bulb_estimate.h"
#include "bvh/bvh_lists.h"
#include "hit/sharp.h"
#include "repetition/repeated_rays.h"
#include "shadow/shadow_cone.h"
#include "types/numerics.h"
#include "types/shading_packet.h"
#include "types/tile_context.h"

// The slope of the cone about a hard shadow ray: it covers rounding.
#define HARD_SHADOW_SLOPE 1e-3f

// Sets the bundle of all shadow rays of a group. Returns false if it is too wide, or if no hit faces the light.
static bool bundle_of_group(const struct shading_packet *stage, int count, const float light[3],
                            struct light_bundle *ball) {
    struct vec least = {v_splat(INFINITY), v_splat(INFINITY), v_splat(INFINITY)};
    struct vec most = {v_splat(-INFINITY), v_splat(-INFINITY), v_splat(-INFINITY)};
    for (int i = 0; i < count; i++) {
        vmask front = stage[i].front;
        struct vec p = stage[i].point;
        least = (struct vec){v_select(front, v_min(p.x, least.x), least.x),
                             v_select(front, v_min(p.y, least.y), least.y),
                             v_select(front, v_min(p.z, least.z), least.z)};
        most = (struct vec){v_select(front, v_max(p.x, most.x), most.x),
                            v_select(front, v_max(p.y, most.y), most.y),
                            v_select(front, v_max(p.z, most.z), most.z)};
    }
    float low[3] = {v_reduce_min(least.x), v_reduce_min(least.y), v_reduce_min(least.z)};
    float high[3] = {most_lane(most.x), most_lane(most.y), most_lane(most.z)};
    return light_bundle_of(low, high, light, ball);
}

// Returns whether the bundle misses all parts of a sharp group, by their balls.
static bool bundle_misses_parts(const struct light_bundle *bundle, const struct sharp *sharp,
                                float q) {
    bool missed = sharp && sharp->balls > 0;
    for (int k = 0; missed && k < sharp->balls; k++)
        missed = bundle_misses(bundle, sharp->ball[k], sharp->ball[k][3], q);
    return missed;
}

// Adds shape i to the occluders unless its bounding sphere, or those of all its parts, are clear of the bundle.
// Without a bundle (NULL) every shape is added, and planes and repeated shapes always are.
INLINE void add_occluder(int i, const struct light_bundle *ball, const struct tile_context *work) {
    const struct known_scene *scene = KNOWN(work->scene);
    const struct primitive *s = &scene->primitives[i];
    float q = scene->model.shadows == SHADOWS_HARD ? HARD_SHADOW_SLOPE : scene->lit_slope;
    q = lit_slope_for(s, q);
    if (!ball || s->eval == EVAL_LINEAR || REPEATED(s) ||
        !(bundle_misses(ball, s->position, s->bound, q) ||
          (IS_GROUP(s) && bundle_misses_parts(ball, SHARP_OF(s), q))))
        add_to_set(&work->scratch->occluders, i);
}

KERNEL_SHARED void list_occluders(const struct shading_packet *stage, int count,
                                  const struct tile_context *work) {
    struct light_bundle ball;
    bool known = bundle_of_group(stage, count, work->light, &ball);
    if (HAS_BVH(work->scene) && known) {
        const struct known_scene *scene = KNOWN(work->scene);
        float q = scene->model.shadows == SHADOWS_HARD ? HARD_SHADOW_SLOPE : scene->lit_slope;
        bvh_list_towards_light(&ball, q, work);
        return;
    }
    clear_set(&work->scratch->occluders);
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
        add_occluder(i, known ? &ball : NULL, work);
}
