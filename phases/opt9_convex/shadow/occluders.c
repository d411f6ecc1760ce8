// Which shapes can darken the shadow rays of a group of packets. The quadratic a·t² − 2·b·t + c of a cone and a
// sphere: see struct shadow_cone.
#include "bulb/bulb_estimate.h"
#include "bvh/bvh_lists.h"
#include "repetition/repeated_rays.h"
#include "shadow/shadow_cone.h"
#include "types/numerics.h"
#include "types/shading_packet.h"
#include "types/tile_context.h"

// The slope of the cone about a hard shadow ray: it covers rounding.
#define HARD_SHADOW_SLOPE 1e-3f

// A bundle of shadow rays. They start in the ball, and their directions differ from to_light by at most
// `spread`.
struct light_bundle {
    float centre[3], radius, to_light[3], spread;
};

// Sets the bundle of all shadow rays of a group. Returns false if the ball is too large for the distance to
// the light, or if no hit faces it.
static bool light_bundle_of(const struct shading_packet *stage, int count, const struct view *view,
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
    const vfloat low[3] = {least.x, least.y, least.z}, high[3] = {most.x, most.y, most.z};
    float square = 0, distance = 0;
    for (int k = 0; k < 3; k++) {
        float a = least_lane(low[k]), b = -least_lane(v_splat(0.0f) - high[k]);
        ball->centre[k] = 0.5f * (a + b);
        square += 0.25f * (b - a) * (b - a);
        ball->to_light[k] = (float)view->light_position[k] - ball->centre[k];
        distance += ball->to_light[k] * ball->to_light[k];
    }
    distance = sqrtf(distance);
    ball->radius = sqrtf(square) * (1 + 1e-4f);
    ball->spread = ball->radius / (distance - ball->radius);
    for (int k = 0; k < 3; k++)
        ball->to_light[k] /= distance;
    return ball->radius <
           0.25f * distance; // false if nothing faces the light: the radius is infinite or NaN
}

// Returns whether no cone of slope q about a ray of the bundle meets the shape's bounding sphere.
static bool bundle_misses(const struct light_bundle *ball, const struct primitive *s, float q) {
    float radius = s->bound + ball->radius, along = 0, c = -radius * radius;
    q += ball->spread;
    for (int k = 0; k < 3; k++) {
        float v = s->position[k] - ball->centre[k];
        along += v * ball->to_light[k];
        c += v * v;
    }
    float b = along + q * radius;
    if (!(c > 0 && q < 1) || b <= 0)
        return c > 0 && q < 1;
    return b * b * (1 + 1e-4f) < (1 - q * q) * c;
}

// Adds shape i to the occluders unless its bounding sphere is clear of the bundle. Without a bundle (NULL) every
// shape is added, and planes and repeated shapes always are.
INLINE void add_occluder(int i, const struct light_bundle *ball, const struct tile_context *work) {
    const struct known_scene *scene = KNOWN(work->scene);
    const struct primitive *s = &scene->primitives[i];
    float q = scene->model.shadows == SHADOWS_HARD ? HARD_SHADOW_SLOPE : scene->lit_slope;
    q = lit_slope_for(s, q);
    if (!ball || s->eval == EVAL_LINEAR || REPEATED(s) || !bundle_misses(ball, s, q))
        add_to_set(&work->scratch->occluders, i);
}

KERNEL_SHARED void list_occluders(const struct shading_packet *stage, int count,
                                  const struct tile_context *work) {
    struct light_bundle ball;
    bool known = light_bundle_of(stage, count, work->view, &ball);
    if (HAS_BVH(work->scene) && known) {
        const struct known_scene *scene = KNOWN(work->scene);
        float q = scene->model.shadows == SHADOWS_HARD ? HARD_SHADOW_SLOPE : scene->lit_slope;
        bvh_list_towards_light(ball.centre, ball.radius, ball.to_light, q + ball.spread, work);
        return;
    }
    clear_set(&work->scratch->occluders);
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
        add_occluder(i, known ? &ball : NULL, work);
}
