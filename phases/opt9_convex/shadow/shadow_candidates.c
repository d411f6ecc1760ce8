// Which shapes a packet of shadow rays can camera_hit, where its march may begin and end, and what it is blocked by.
// A cone of slope q about the ray meets a sphere where narrow·t² − 2·lean·t + need = 0, narrow = 1 − q² (`wide`,
// `narrow_part`), lean = v·l + q·R, need = |v|² − R², v from the ray's origin to the centre; `rest` = lean² − narrow·need.
#include "bulb/bulb_estimate.h"
#include "bvh/bvh_lists.h"
#include "core/numerics.h"
#include "core/shading_packet.h"
#include "core/tile_context.h"
#include "repetition/repeated_rays.h"
#include "shadow/shadow_cone.h"

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

INLINE void add_occluder(int i, const struct light_bundle *ball, const struct tile_context *work) {
    const struct known_scene *scene = KNOWN(work->scene);
    const struct primitive *s = &scene->primitives[i];
    float q = scene->model.shadows == SHADOWS_HARD ? HARD_SHADOW_SLOPE : scene->lit_slope;
    q = lit_slope_for(s, q);
    if (!ball || s->eval == EVAL_LINEAR || REPEATED(s) || !bundle_misses(ball, s, q))
        add_to_set(&work->scratch->occluders, i);
}

// To desk->shading: those that can shade the group.
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

KERNEL_INLINE void candidate_plane(const struct primitive *s, int i, struct shadow_rays *r,
                                   const struct tile_context *work,
                                   struct shadow_candidate *candidate) {
    COUNT(candidate_plane, call);
    COUNT(candidate_plane, scalar);
    float q = KNOWN(work->scene)->lit_slope;
    vmask self = is_shape(r->shape, i);
    vfloat height = v_zero_where(self, height_over(s, r->point)),
           slope = add_dot(s->normal, r->to_light);
    candidate->origin.x = height;
    candidate->direction.x = slope;
    vmask clear = v_or(self, plane_clears(height, slope, q, KNOWN(work->scene)));
    r->end = v_select(clear, r->end, v_splat(INFINITY));
    candidate->from = height / v_max(v_splat(1.0f) - slope, v_splat(1e-6f));
    r->leap_limit = v_select(self, r->leap_limit, v_min(r->leap_limit, candidate->from));
    r->meets_many = v_or(r->meets_many, v_not(clear));
    if (v_any(v_andnot(clear, r->active))) {
        COUNT(candidate_plane, met);
        vfloat t = height / (v_splat(0.0f) - slope);
        vmask met = v_and(v_andnot(self, r->active),
                          v_and(v_cmp_lt(slope, v_splat(0.0f)), v_cmp_lt(t, r->first)));
        r->first = v_select(met, t, r->first);
        r->cosine = v_select(met, v_splat(0.0f) - slope, r->cosine);
    }
}

KERNEL_INLINE void first_entry(const struct primitive *s, int i, struct shadow_rays *r, vmask met) {
    COUNT(first_entry, call);
    vmask self = is_shape(r->shape, i);
    struct vec at, o = vec_select(self, r->local, to_local(s, r->point)),
                   d = turned(s, r->to_light);
    vfloat t;
    vmask behind, in = enter(o, d, s, v_andnot(self, met), &t, &at, &behind);
    in = v_and(in, v_cmp_lt(t, r->first));
    if (v_any(in)) {
        COUNT(first_entry, in);
        r->first = v_select(in, t, r->first);
        r->cosine = v_select(in, entry_cosine(at, d, s, r), r->cosine);
    }
}

INLINE void candidate_solid(const struct primitive *s, int i, struct shadow_rays *r,
                            const struct tile_context *work, struct shadow_candidate *candidate) {
    COUNT(candidate_solid, call);
    COUNT(candidate_solid, scalar);
    float q = lit_slope_for(s, KNOWN(work->scene)->lit_slope);
    bool bulb = s->type == SHAPE_MANDELBULB;
    vfloat zero = v_splat(0.0f);
    vmask self = is_shape(r->shape, i);
    struct shadow_cone c = shadow_cone_to(to_centre(s, r->point), r->to_light, s, q);
    vmask self_bulge = v_and(self, convex_from(s, r->local, r->facing, KNOWN(work->scene)));
    vmask met = v_andnot(v_or(cone_misses(c, q), self_bulge), r->active);
    r->end = v_select(met, v_max(cone_exit(c, q), r->end), r->end);
    // h ≥ t as long as |v − t·l| ≥ R + t: until then something else is nearer, for h is 0 at t = 0.
    vfloat towards = c.along + v_splat(s->bound);
    vfloat from = v_select(v_cmp_gt(towards, zero),
                           c.need / v_max(towards + towards, v_splat(1e-20f)), v_splat(INFINITY));
    if (bulb) {
        COUNT(candidate_solid, bulb);
        from = v_splat(BULB_SHARE / (1 + BULB_SHARE)) *
               (v_sqrt(c.need + v_splat(s->bound_sq)) - v_splat(s->bound));
    }
    // From a plane the march is at most at height facing·t: a cone once more, of that slope.
    vfloat share = v_splat(bulb ? BULB_SHARE : 1.0f), s_slope = r->facing / share;
    vfloat lean = v_madd(s_slope, v_splat(s->bound), c.along),
           narrow_part = v_nmadd(s_slope, s_slope, v_splat(1.0f));
    vfloat rest = v_msub(lean, lean, narrow_part * c.need);
    vfloat meets = c.need / (lean + v_sqrt(v_max(rest, zero)));
    meets = v_select(v_and(v_cmp_gt(lean, zero), v_cmp_ge(rest, zero)), meets, v_splat(INFINITY));
    from = v_select(
        v_and(v_and(r->on_plane, v_cmp_lt(s_slope, v_splat(0.99f))), v_cmp_gt(c.need, zero)), meets,
        from);
    from = v_zero_where(self, v_max(from, zero));
    candidate->from = from;
    r->leap_limit = v_min(r->leap_limit, from);
    if (v_any(met) && !bulb)
        first_entry(s, i, r, met);
}

// A copy may be the nearest anywhere, and bring the term of any step below 1.
INLINE void candidate_cells(const struct primitive *s, int i, struct shadow_rays *r,
                            const struct tile_context *work, struct shadow_candidate *candidate) {
    candidate->from = r->leap_limit = v_splat(0.0f);
    r->end = v_splat(INFINITY);
    first_entry_in_cells(s, i, r, &work->scene->model.march);
}

KERNEL_INLINE void set_candidate_ray(const struct shadow_rays *r, int i,
                                     struct shadow_candidate *candidate,
                                     const struct tile_context *work) {
    COUNT(set_candidate_ray, call);
    const struct known_scene *scene = KNOWN(work->scene);
    const struct primitive *s = &scene->primitives[i];
    candidate->wake_bound = v_splat(-INFINITY);
    if (s->eval == EVAL_LINEAR)
        return;
    if (r->from_planes) {
        COUNT(set_candidate_ray, floor);
        candidate->origin = to_local(s, r->point);
        candidate->direction = turned(s, r->to_light);
        candidate->power = false;
        return;
    }
    COUNT(set_candidate_ray, solid);
    vmask self = is_shape(r->shape, i);
    candidate->origin = vec_select(self, r->local, to_local(s, r->point));
    candidate->direction = turned(s, r->to_light);
    candidate->power =
        s->type == SHAPE_SPHERE && v_any(v_and(self, r->active)) && !REPEATED(s) && !scene->bulbs;
    if (candidate->power) {
        COUNT(set_candidate_ray, power);
        candidate->constant = v_zero_where(self, vec_dot(candidate->origin, candidate->origin) -
                                                     v_splat(s->bound_sq));
        candidate->slope = v_splat(2.0f) * vec_dot(candidate->origin, candidate->direction);
    }
}

// Of rays that all come from one plane, so that no solid is their self.
INLINE void candidate_solid_from_plane(const struct primitive *s, struct shadow_rays *r,
                                       const struct known_scene *scene,
                                       struct shadow_candidate *candidate) {
    COUNT(candidate_solid_from_plane, call);
    COUNT(candidate_solid_from_plane, scalar);
    float q = scene->lit_slope;
    vfloat zero = v_splat(0.0f);
    struct shadow_cone c = shadow_cone_to(to_centre(s, r->point), r->to_light, s, q);
    vmask met = v_andnot(cone_misses(c, q), r->active);
    // The march is at most at height facing·t: a cone once more, of that slope.
    vfloat lean = v_madd(r->facing, v_splat(s->bound), c.along);
    vfloat narrow_part = v_nmadd(r->facing, r->facing, v_splat(1.0f));
    vfloat rest = v_msub(lean, lean, narrow_part * c.need);
    vfloat from = c.need / (lean + v_sqrt(v_max(rest, zero)));
    from = v_select(v_and(v_cmp_gt(lean, zero), v_cmp_ge(rest, zero)), from, v_splat(INFINITY));
    candidate->from = v_max(from, zero);
    r->leap_limit = v_min(r->leap_limit, candidate->from);
    if (!v_any(met))
        return;
    COUNT(candidate_solid_from_plane, met);
    r->meets_many = v_or(r->meets_many, s->convex ? v_and(r->meets_one, met) : met);
    r->meets_one = v_or(r->meets_one, met);
    r->end = v_select(met, v_max(cone_exit(c, q), r->end), r->end);
    struct vec at, d = turned(s, r->to_light);
    vfloat t;
    vmask behind, in = enter(to_local(s, r->point), d, s, met, &t, &at, &behind);
    in = v_and(in, v_cmp_lt(t, r->first));
    if (v_any(in)) {
        COUNT(candidate_solid_from_plane, in);
        r->first = v_select(in, t, r->first);
        r->cosine = v_select(in, entry_cosine(at, d, s, r), r->cosine);
    }
}

INLINE void mark_rays_from_planes(int i, struct shadow_rays *r, const struct known_scene *scene) {
    if (scene->primitives[i].eval == EVAL_LINEAR) {
        COUNT(list_candidates, plane);
        r->on_plane = v_or(r->on_plane, is_shape(r->shape, i));
    }
}

INLINE void set_candidate(int i, struct shadow_rays *r, const struct tile_context *work,
                          struct shadow_candidate *candidates) {
    const struct primitive *s = &KNOWN(work->scene)->primitives[i];
    if (s->eval == EVAL_LINEAR)
        candidate_plane(s, i, r, work, &candidates[i]);
    else if (REPEATED(s))
        candidate_cells(s, i, r, work, &candidates[i]);
    else if (r->from_planes && s->type != SHAPE_MANDELBULB)
        candidate_solid_from_plane(s, r, KNOWN(work->scene), &candidates[i]);
    else
        candidate_solid(s, i, r, work, &candidates[i]);
}

INLINE void keep_candidate(int i, struct shadow_rays *r, const struct tile_context *work,
                           struct shadow_candidate *candidates, struct shape_set *listed) {
    const struct known_scene *scene = KNOWN(work->scene);
    struct shadow_candidate *candidate = &candidates[i];
    COUNT(list_candidates, shape);
    if (!scene->bulbs && !v_any(v_and(r->active, v_cmp_lt(candidate->from, r->end))))
        return;
    add_to_set(listed, i);
    set_candidate_ray(r, i, candidate, work);
}

void list_candidates(struct shadow_rays *restrict r, struct shadow_candidate *restrict candidates,
                     struct shape_set *restrict listed, const struct tile_context *work) {
    const struct known_scene *scene = KNOWN(work->scene);
    COUNT(list_candidates, call);
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
        mark_rays_from_planes(i, r, scene);
    r->from_planes = !v_any(v_andnot(r->on_plane, r->active));
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
        set_candidate(i, r, work, candidates);
    clear_set(listed);
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
        keep_candidate(i, r, work, candidates, listed);
}
