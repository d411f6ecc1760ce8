// What a hit looks like: normal, light (B. T. Phong, "Illumination for computer generated
// pictures", CACM 18 (1975)), mirror by recursion, fog.
#include "trace.h"

// Materials of four hits, gathered.
struct surfaces {
    struct vec color;
    real reflectivity, shininess;
};

static struct surfaces gather(real shape, mask found, const struct model *model) {
    double id[LANES], values[5][LANES];
    _mm256_storeu_pd(id, choose(found, shape, set(0.0)));
    for (int lane = 0; lane < LANES; lane++) {
        const struct material *m = &model->materials[model->shapes[(int)id[lane]].material];
        for (int i = 0; i < 3; i++)
            values[i][lane] = m->color[i];
        values[3][lane] = m->reflectivity;
        values[4][lane] = m->shininess;
    }
    return (struct surfaces){
        {_mm256_loadu_pd(values[0]), _mm256_loadu_pd(values[1]), _mm256_loadu_pd(values[2])},
        _mm256_loadu_pd(values[3]),
        _mm256_loadu_pd(values[4])};
}

// Forward differences of the scene's distance, towards the side the ray comes from.
static struct vec normal_at(struct vec p, struct vec direction, mask found,
                            const struct prepared *scene) {
    COUNT(normal_at, call);
    real step = set(scene->model.march.normal_step), nearest = set(0.0);
    mask done = not_in(found);
    real values[4]; // at p, and moved along x, y, z
    for (int i = 0; i < 4; i++) {
        COUNT(normal_at, moved);
        struct vec moved = {p.x + (i == 1 ? step : set(0.0)), p.y + (i == 2 ? step : set(0.0)),
                            p.z + (i == 3 ? step : set(0.0))};
        values[i] = sdf(moved, scene, done, &nearest);
    }
    struct vec gradient = {values[1] - values[0], values[2] - values[0], values[3] - values[0]};
    real length = vec_norm(gradient);
    mask away = greater(vec_dot(direction, gradient), set(0.0));
    struct vec n = vec_scale(gradient, negate_where(away, set(1.0) / length));
    // No direction, as at a centre: towards the ray.
    return vec_choose(greater(length, set(0.0)), n, vec_scale(direction, set(-1.0)));
}

static struct vec light_at(struct vec p, struct vec n, struct vec direction, mask found,
                           const struct surfaces *surface, const struct world *world) {
    COUNT(light_at, call);
    real zero = set(0.0);
    struct vec base = surface->color;
    struct vec to_light = vec_along(vec_set(world->view->light_position), p, set(-1.0));
    real distance = vec_norm(to_light);
    to_light = vec_scale(to_light, set(1.0) / distance);
    real facing = vec_dot(n, to_light);
    // Turned away: both terms are zero whatever the shadow. No direction to a light on the surface.
    mask lit = both(found, both(greater(facing, zero), greater(distance, zero)));
    struct vec color = vec_scale(base, set(0.01)); // ambient
    if (!bits(lit))
        return color;
    ACTIVE(__builtin_popcount((unsigned)bits(lit)));
    COUNT(light_at, lit);
    real reach = shadow(p, to_light, distance, lit, world->scene) / distance;
    ACTIVE(__builtin_popcount((unsigned)bits(lit)));
    // Of the light's direction: minus the paper's R.
    real shine = vec_dot(vec_reflect(to_light, n), direction);
    real specular = set(0.2) * power_of(most_of(shine, set(1e-300)), surface->shininess);
    specular = both(specular, greater(shine, zero));
    struct vec emission = vec_set(world->view->light_emission);
    struct vec bright = {mul_add(emission.x * mul_add(base.x, facing, specular), reach, color.x),
                         mul_add(emission.y * mul_add(base.y, facing, specular), reach, color.y),
                         mul_add(emission.z * mul_add(base.z, facing, specular), reach, color.z)};
    return vec_choose(lit, bright, color);
}

void trace(struct vec origin, struct vec direction, mask active, int bounce,
           const struct world *world, struct shaded *result) {
    ACTIVE(__builtin_popcount((unsigned)bits(active)));
    COUNT(trace, call);
    const struct model *model = &world->scene->model;
    struct vec background = vec_set(model->background);
    *result = (struct shaded){.color = background};
    ray_march(origin, direction, active, world->scene, &result->hit);
    mask found = result->hit.found;
    if (!bits(found))
        return;
    ACTIVE(__builtin_popcount((unsigned)bits(found)));
    struct vec p = result->hit.point;
    struct vec n = normal_at(p, direction, found, world->scene);
    struct surfaces surface = gather(result->hit.shape, found, model);
    struct vec color = light_at(p, n, direction, found, &surface, world);
    ACTIVE(__builtin_popcount((unsigned)bits(found)));
    if (model->features.mirrors && bounce < model->march.max_bounces) {
        COUNT(trace, mirrors);
        // One reflective ray makes the call; the others are masked out of it and of its colour.
        mask mirror = both(found, greater(surface.reflectivity, set(0.0)));
        if (bits(mirror)) {
            ACTIVE(__builtin_popcount((unsigned)bits(mirror)));
            COUNT(trace, mirrored);
            struct vec start = vec_along(p, n, set(model->march.surface_offset));
            struct shaded seen;
            trace(start, vec_reflect(direction, n), mirror, bounce + 1, world, &seen);
            real share = both(mirror, surface.reflectivity * set(0.1));
            color = vec_along(color, vec_choose(mirror, seen.color, color), share);
        }
    }
    ACTIVE(__builtin_popcount((unsigned)bits(found)));
    if (model->features.fog) {
        COUNT(trace, fog);
        real far_sq = vec_dot(p, p);
        color = vec_scale(color, exp_of(set(-model->fog) * far_sq * root(far_sq)));
    }
    result->color = vec_choose(found, color, background);
    struct vec zero = {set(0.0), set(0.0), set(0.0)};
    result->normal = vec_choose(found, n, zero);
}
