// Which shapes can come between a group of packets and the light: told once for all their rays, from a ball about their
// hits and a cone about the way from there to the light.
#ifndef OPT9_OCCLUDERS_H
#define OPT9_OCCLUDERS_H

#include "bulb/bulb_estimate.h"
#include "bvh/bvh_lists.h"
#include "core/numerics.h"
#include "core/shading_packet.h"
#include "repetition/repeated_rays.h"

// A hard shadow's ray is a line: so much of a slope for what is rounded in it.
#define HARD_SHADOW_SLOPE 1e-3f

// The group's hits lie in this ball, and their rays to the light go as `to_light`, but for `spread` at the most.
struct light_bundle {
    float centre[3], radius, to_light[3], spread;
};

static bool light_bundle_of(const struct shading_packet *stage, int count, const struct view *view,
                            struct light_bundle *ball) {
    COUNT(light_bundle_of, call);
    COUNT(light_bundle_of, scalar);
    struct vec least = {v_splat(INFINITY), v_splat(INFINITY), v_splat(INFINITY)};
    struct vec most = {v_splat(-INFINITY), v_splat(-INFINITY), v_splat(-INFINITY)};
    for (int i = 0; i < count; i++) {
        COUNT(light_bundle_of, packet);
        vmask lit = stage[i].lit;
        struct vec p = stage[i].point;
        least = (struct vec){v_select(lit, v_min(p.x, least.x), least.x),
                             v_select(lit, v_min(p.y, least.y), least.y),
                             v_select(lit, v_min(p.z, least.z), least.z)};
        most = (struct vec){v_select(lit, v_max(p.x, most.x), most.x),
                            v_select(lit, v_max(p.y, most.y), most.y),
                            v_select(lit, v_max(p.z, most.z), most.z)};
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
    return ball->radius < 0.25f * distance; // not where nothing is lit: −∞ and NaN are not
}

// Whether no cone of slope q about a ray from the ball to the light meets the shape's bounding sphere.
static bool bundle_misses(const struct light_bundle *ball, const struct primitive *s, float q) {
    COUNT(bundle_misses, call);
    float radius = s->bound + ball->radius, along = 0, need = -radius * radius;
    q += ball->spread;
    for (int k = 0; k < 3; k++) {
        float v = s->position[k] - ball->centre[k];
        along += v * ball->to_light[k];
        need += v * v;
    }
    float lean = along + q * radius;
    if (!(need > 0 && q < 1) || lean <= 0)
        return need > 0 && q < 1;
    COUNT(bundle_misses, leans);
    return lean * lean * (1 + 1e-4f) < (1 - q * q) * need;
}

INLINE void shade_from(int i, const struct light_bundle *ball, const struct tile_context *work) {
    const struct known_scene *scene = KNOWN(work->scene);
    const struct primitive *s = &scene->placed[i];
    float q = scene->model.shadows == SHADOWS_HARD ? HARD_SHADOW_SLOPE : scene->lit_slope;
    q = lit_slope_for(s, q);
    if (!ball || s->way == EVAL_LINEAR || REPEATED(s) || !bundle_misses(ball, s, q))
        add_to_set(&work->scratch->occluders, i);
}

// To desk->shading: those that can shade the group.
static void list_occluders(const struct shading_packet *stage, int count,
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
    EACH_SHAPE(work->scene, shade_from, known ? &ball : NULL, work);
}

#endif
