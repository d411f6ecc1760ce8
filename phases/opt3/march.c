// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). Four rays march until the last is done.
#include "trace.h"

enum { ALL = (1 << LANES) - 1 };

void ray_march(struct vec origin, struct vec direction, mask active, const struct prepared *scene,
               struct hit *hit) {
    COUNT(ray_march, call);
    mask done = not_in(active);
    real hit_distance = set(scene->model.march.hit_distance), bounds_sq = set(scene->bounds_sq);
    mask found = set(0.0);
    real t = set(0.0), shape = set(-1.0), evals = set(0.0);
    struct vec point = origin;
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        real nearest = set(-1.0);
        ACTIVE(LANES - __builtin_popcount((unsigned)bits(done)));
        COUNT(ray_march, step);
        real distance = sdf(point, scene, done, &nearest);
        evals = evals + but_not(done, set(1.0));
        t = t + but_not(done, distance);
        point = vec_along(origin, direction, t);
        mask reached = but_not(done, less(distance, hit_distance));
        mask outside = but_not(done, greater(vec_dot(point, point), bounds_sq));
        mask ended = either(reached, outside);
        if (bits(ended)) {
            found = either(found, reached);
            shape = choose(reached, nearest, shape);
            done = either(done, ended);
            if (bits(done) == ALL)
                break;
        }
    }
    *hit = (struct hit){found, t, point, shape, evals};
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds.
static real soft_shadow(struct vec point, struct vec to_light, mask active,
                        const struct prepared *scene) {
    COUNT(soft_shadow, call);
    mask done = not_in(active);
    real hit_distance = set(scene->model.march.hit_distance), bounds_sq = set(scene->bounds_sq);
    real strength = set(scene->model.shadow_strength), zero = set(0.0), nearest = zero;
    real least = set(1.0), previous = set(1e20), t = set(scene->model.march.surface_offset);
    struct vec p = vec_along(point, to_light, t);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        ACTIVE(LANES - __builtin_popcount((unsigned)bits(done)));
        COUNT(soft_shadow, eval);
        real h = sdf(p, scene, done, &nearest);
        done = either(done, less(h, hit_distance));
        if (bits(done) == ALL)
            break;
        ACTIVE(LANES - __builtin_popcount((unsigned)bits(done)));
        COUNT(soft_shadow, step);
        real y = h * h / (set(2.0) * previous), inside = mul_sub(h, h, y * y), beyond = t - y;
        // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
        mask sound = but_not(done, both(greater(inside, zero), greater(beyond, zero)));
        // strength·√inside/beyond < least, asked without the root: it is seldom so.
        real scaled = least * beyond;
        mask darker = both(sound, less(strength * strength * inside, scaled * scaled));
        if (bits(darker)) {
            ACTIVE(__builtin_popcount((unsigned)bits(darker)));
            COUNT(soft_shadow, darker);
            least = choose(darker, strength * root(inside) / beyond, least);
        }
        previous = h;
        t = t + but_not(done, h);
        p = vec_along(point, to_light, t);
        done = either(done, greater(vec_dot(p, p), bounds_sq));
    }
    return least;
}

static real hard_shadow(struct vec point, struct vec to_light, real distance, mask active,
                        const struct prepared *scene) {
    COUNT(hard_shadow, call);
    mask done = not_in(active);
    real hit_distance = set(scene->model.march.hit_distance), bounds_sq = set(scene->bounds_sq);
    real lit = set(1.0), nearest = lit, t = set(scene->model.march.surface_offset);
    struct vec p = vec_along(point, to_light, t);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        ACTIVE(LANES - __builtin_popcount((unsigned)bits(done)));
        COUNT(hard_shadow, test);
        done = either(done, not_in(less(t, distance)));
        if (bits(done) == ALL)
            break;
        ACTIVE(LANES - __builtin_popcount((unsigned)bits(done)));
        COUNT(hard_shadow, step);
        real h = sdf(p, scene, done, &nearest);
        mask blocked = but_not(done, less(h, hit_distance));
        lit = but_not(blocked, lit);
        done = either(done, blocked);
        t = t + but_not(done, h);
        p = vec_along(point, to_light, t);
        done = either(done, greater(vec_dot(p, p), bounds_sq));
    }
    return lit;
}

// 1: the light reaches the point, 0: it does not; between, the penumbra of a soft shadow.
real shadow(struct vec point, struct vec to_light, real distance, mask active,
            const struct prepared *scene) {
    COUNT(shadow, call);
    switch (scene->model.shadows) {
    case SHADOWS_SOFT: return soft_shadow(point, to_light, active, scene);
    case SHADOWS_HARD: return hard_shadow(point, to_light, distance, active, scene);
    default: return set(1.0);
    }
}
