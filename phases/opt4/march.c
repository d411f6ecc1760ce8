// Sphere tracing: J. C. Hart, "Sphere tracing: a geometric method for the antialiased ray tracing
// of implicit surfaces", The Visual Computer 12 (1996). Eight rays march until the last is done.
#include "trace.h"

enum { ALL = (1 << LANES) - 1 };

// A ray leaves the bounds when |o + t·d|² > radius²: a polynomial in t, free of the point itself.
struct exit {
    real linear, constant; // t·(t + linear) + constant > 0
};

static struct exit leaving(struct place origin, struct vec direction, const struct model *model) {
    COUNT(leaving, call);
    COUNT(leaving, scalar);
    float radius = (float)model->march.bounds_radius;
    struct vec o = origin.hi;
    return (struct exit){set(2.0f) * vec_dot(o, direction), vec_dot(o, o) - set(radius * radius)};
}

static inline mask outside(struct exit exit, real t) {
    return greater(mul_add(t, t + exit.linear, exit.constant), set(0.0f));
}

// The hit test that float can keep: below half an ulp of t, 2^-24·t at the most, a step no longer
// moves the ray, and it would stall there until the step cap.
static inline mask reaches(real distance, real t, real hit_distance) {
    return less(distance, most_of(hit_distance, t * set(0x1p-24f)));
}

// Newton's last step, where the hit distance is near what a float of t can resolve: more than h is left
// to go where a ray grazes, 33 times on scene0's plane at the horizon. There reaches() stops 6e-6 above
// the plane, 2e-4 short of it; with this step 1.5e-5, and 103 dB to the truth instead of 96 (n = 90).
// From outside, and no further than place_at() is exact. A larger hit distance means what it means to
// every phase.
static inline real newton(real h, real t, real slope) {
    COUNT(newton, call);
    mask fine = both(greater(h, set(0.0f)), less(h, t * set(0x1p-20f)));
    return choose(fine, h / most_of(slope, set(0x1p-9f)), h);
}

void ray_march(struct place origin, struct vec direction, mask active, const struct world *world,
               struct hit *hit) {
    COUNT(ray_march, call);
    const struct prepared *scene = world->scene;
    approach_shapes(origin, direction, scene, world->approach);
    struct exit exit = leaving(origin, direction, &scene->model);
    real hit_distance = set((float)scene->model.march.hit_distance);
    mask done = not_in(active), found = set(0.0f);
    // t and the last step apart: their sum, rounded, would lose what places the hit on the surface.
    real t = set(0.0f), last = set(0.0f), shape = set(-1.0f), evals = set(0.0f);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        real nearest = set(-1.0f);
        ACTIVE(LANES - count_of(done));
        COUNT(ray_march, step);
        real distance = sdf(world->approach, t, scene, done, &nearest);
        evals = evals + but_not(done, set(1.0f));
        mask reached = but_not(done, reaches(distance, t, hit_distance));
        last = choose(reached, distance, last);
        t = t + but_not(either(done, reached), distance);
        mask ended = either(reached, but_not(done, outside(exit, t)));
        if (bits(ended)) {
            found = either(found, reached);
            shape = choose(reached, nearest, shape);
            done = either(done, ended);
            if (bits(done) == ALL)
                break;
        }
    }
    ACTIVE(count_of(found));
    COUNT(ray_march, end);
    *hit = (struct hit){.found = found, .shape = shape, .evals = evals};
    if (bits(found)) {
        real slope;
        hit->normal = normal_at(t, last, direction, found, shape, world, &slope);
        ACTIVE(count_of(found));
        last = newton(last, t, slope);
        hit->point = place_at(origin, direction, t, last);
    }
    hit->t = t + last;
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds.
static real soft_shadow(mask active, struct exit exit, const struct world *world) {
    COUNT(soft_shadow, call);
    const struct prepared *scene = world->scene;
    const struct model *model = &scene->model;
    mask done = not_in(active);
    real hit_distance = set((float)model->march.hit_distance);
    real strength = set((float)model->shadow_strength), zero = set(0.0f), nearest = zero;
    real least = set(1.0f), previous = set(1e20f), t = set((float)model->march.surface_offset);
    for (int step = 0; step < model->march.max_steps; step++) {
        ACTIVE(LANES - count_of(done));
        COUNT(soft_shadow, eval);
        real h = sdf(world->approach, t, scene, done, &nearest);
        done = either(done, reaches(h, t, hit_distance));
        if (bits(done) == ALL)
            break;
        ACTIVE(LANES - count_of(done));
        COUNT(soft_shadow, step);
        real square = h * h, y = square / (set(2.0f) * previous);
        real inside = neg_mul_add(y, y, square), beyond = t - y;
        // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
        // In float it is noise wherever inside/h² is of the order of h's own error, 1e-5 at least.
        mask sound = both(greater(inside, square * set(2e-5f)), greater(beyond, zero));
        // strength·√inside/beyond < least, asked without the root: it is seldom so.
        real scaled = least * beyond;
        mask darker =
            but_not(done, both(sound, less(strength * strength * inside, scaled * scaled)));
        if (bits(darker)) {
            ACTIVE(count_of(darker));
            COUNT(soft_shadow, darker);
            least = choose(darker, strength * root(inside) / beyond, least);
        }
        previous = h;
        t = t + but_not(done, h);
        done = either(done, outside(exit, t));
    }
    return least;
}

static real hard_shadow(real distance, mask active, struct exit exit, const struct world *world) {
    COUNT(hard_shadow, call);
    const struct prepared *scene = world->scene;
    mask done = not_in(active);
    real hit_distance = set((float)scene->model.march.hit_distance);
    real lit = set(1.0f), nearest = lit, t = set((float)scene->model.march.surface_offset);
    for (int step = 0; step < scene->model.march.max_steps; step++) {
        ACTIVE(LANES - count_of(done));
        COUNT(hard_shadow, test);
        done = either(done, not_in(less(t, distance)));
        if (bits(done) == ALL)
            break;
        ACTIVE(LANES - count_of(done));
        COUNT(hard_shadow, step);
        real h = sdf(world->approach, t, scene, done, &nearest);
        mask blocked = but_not(done, reaches(h, t, hit_distance));
        lit = but_not(blocked, lit);
        done = either(done, blocked);
        t = t + but_not(done, h);
        done = either(done, outside(exit, t));
    }
    return lit;
}

// 1: the light reaches the point, 0: it does not; between, the penumbra of a soft shadow.
real shadow(struct place point, struct vec to_light, real distance, mask active,
            const struct world *world) {
    COUNT(shadow, call);
    const struct prepared *scene = world->scene;
    if (scene->model.shadows == SHADOWS_NONE)
        return set(1.0f);
    approach_shapes(point, to_light, scene, world->approach);
    struct exit exit = leaving(point, to_light, &scene->model);
    return scene->model.shadows == SHADOWS_SOFT ? soft_shadow(active, exit, world)
                                                : hard_shadow(distance, active, exit, world);
}
