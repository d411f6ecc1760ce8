// Shadow rays that need no march. The soft shadow is the paper's: the least of strength·√(h² − y²)/(t − y) over the
// steps of a march by the distance h to the whole scene, y = h²/(2·previous h). It depends on the steps, so a shape
// that only touches the march changes it; but of most rays it can be told without one. NOTES.md has the proofs.
#include "cone.h"

// The group's hits lie in this ball, and their rays to the light go as `to_light`, but for `spread` at the most.
struct ball {
    float centre[3], radius, to_light[3], spread;
};

static bool ball_of(const struct hit hit[GROUP], const struct lighting light[GROUP],
                    const struct view *view, struct ball *ball) {
    COUNT(ball_of, call);
    COUNT(ball_of, scalar);
    real none = set(INFINITY);
    struct vec least = {none, none, none}, most = {-none, -none, -none};
    for (int k = 0; k < GROUP; k++) {
        mask lit = light[k].lit;
        if (!any(lit))
            continue;
        struct vec p = hit[k].point.hi;
        COUNT(ball_of, packet);
        least = (struct vec){choose(lit, least_of(p.x, least.x), least.x),
                             choose(lit, least_of(p.y, least.y), least.y),
                             choose(lit, least_of(p.z, least.z), least.z)};
        most = (struct vec){choose(lit, most_of(p.x, most.x), most.x),
                            choose(lit, most_of(p.y, most.y), most.y),
                            choose(lit, most_of(p.z, most.z), most.z)};
    }
    const real low[3] = {least.x, least.y, least.z}, high[3] = {most.x, most.y, most.z};
    float square = 0, distance = 0;
    for (int k = 0; k < 3; k++) {
        float a = least_lane(low[k]), b = -least_lane(-high[k]);
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
static bool ball_clears(const struct ball *ball, const struct placed *s) {
    COUNT(ball_clears, call);
    float radius = s->bound + ball->radius, along = 0, need = -radius * radius;
    float q = s->slope_lit + ball->spread;
    for (int k = 0; k < 3; k++) {
        float v = s->position[k] - ball->centre[k];
        along += v * ball->to_light[k];
        need += v * v;
    }
    float lean = along + q * radius;
    if (!(need > 0 && q < 1))
        return false;
    if (lean <= 0)
        return true;
    COUNT(ball_clears, leans);
    return lean * lean * (1 + 1e-4f) < (1 - q * q) * need;
}

void choose_shading(const struct hit hit[GROUP], const struct lighting light[GROUP],
                    struct world *world) {
    COUNT(choose_shading, call);
    const struct prepared *scene = world->scene;
    struct desk *desk = world->desk;
    struct ball ball;
    bool known = ball_of(hit, light, world->view, &ball);
    desk->shadings = 0;
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct placed *s = &scene->placed[i];
        if (!known || s->way == LINEAR || !ball_clears(&ball, s))
            desk->shading[desk->shadings++] = i;
    }
}

mask cleared(const struct hit *hit, const struct lighting *light, const struct beam *beam,
             const struct world *world) {
    COUNT(cleared, call);
    const struct prepared *scene = world->scene;
    float q = scene->lit_slope;
    struct vec point = hit->point.hi;
    mask clear = light->lit;
    if (scene->model.shadows == SHADOWS_HARD) // of its own shape it asks for the slope, too
        clear = both(clear, not_less(light->facing, set(q)));
    for (int k = 0; k < world->desk->shadings && any(clear); k++) {
        int i = world->desk->shading[k];
        const struct placed *s = &scene->placed[i];
        mask own = both(same_shape(hit->shape, i), hit->smooth), here;
        if (s->way == LINEAR) {
            COUNT(cleared, plane);
            real slope = vec_dot(vec_set(s->normal), light->to_light);
            here = either(own, plane_clears(height_over(s, point), slope, q, &scene->model));
        } else {
            COUNT(cleared, solid);
            here = cone_misses(cone_to(to_centre(s, point), light->to_light, s), s);
            if (any(both(own, but_not(here, clear))))
                here = either(here,
                              both(own, bulges(s, beam->approach[i].origin, light->facing, scene)));
        }
        clear = both(clear, here);
    }
    return clear;
}

// Half of how fast the distance's slope grows at first, along l from a point with normal n: the surface's curvature.
static real half_curvature(struct vec p, struct vec n, struct vec l, real facing,
                           const struct placed *s) {
    COUNT(half_curvature, call);
    real zero = set(0.0f);
    if (s->type == SHAPE_SPHERE) {
        COUNT(half_curvature, sphere);
        COUNT(half_curvature, scalar);
        return neg_mul_add(facing, facing, set(1.0f)) * set(0.5f / s->a);
    }
    if (s->type != SHAPE_CONE && s->type != SHAPE_TORUS)
        return zero;
    COUNT(half_curvature, round);
    real square = most_of(mul_add(p.x, p.x, p.z * p.z), set(1e-30f));
    real round = mul_sub(p.x, l.z, p.z * l.x),
         round_sq = round * round; // along the ring, times its radius
    real ring = set(0.5f) * round_sq * mul_add(n.x, p.x, n.z * p.z) / (square * square);
    if (s->type == SHAPE_CONE)
        return ring;
    COUNT(half_curvature, torus);
    COUNT(half_curvature, scalar);
    real tangent = neg_mul_add(facing, facing, set(1.0f));
    return mul_add(most_of(tangent - round_sq / square, zero), set(0.5f / s->b), ring);
}

real own_shadow(const struct placed *s, struct vec local, struct vec normal,
                const struct lighting *light, const struct model *model) {
    COUNT(own_shadow, call);
    real one = set(1.0f), strength = set((float)model->shadow_strength), facing = light->facing;
    real t = set((float)model->march.surface_offset), hit = set((float)model->march.hit_distance);
    real half = set(0.0f);
    if (s->way != LINEAR)
        half = half_curvature(local, turned(s, normal), turned(s, light->to_light), facing, s);
    real u = most_of(mul_add(half, t, facing), set(1e-12f)), further = mul_add(t, u, t);
    real v = mul_add(half, further, facing), ratio = v * (one + u) / u;
    real inside = neg_mul_add(set(0.25f) * ratio, ratio, one);
    real term =
        strength * v * root(most_of(inside, set(0.0f))) / neg_mul_add(set(0.5f) * ratio, v, one);
    // A march that is within the hit distance at its first step has no term at all.
    mask first = not_less(u * t, hit), second = both(first, not_less(v * further, hit));
    if (model->march.max_steps < 2)
        second = no_lane();
    real least = choose(first, least_of(one, strength * u), one);
    return choose(second, least_of(least, term), least);
}
