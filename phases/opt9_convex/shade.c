// What a hit looks like: light (B. T. Phong, "Illumination for computer generated
// pictures", CACM 18 (1975)), mirror by recursion, fog.
#include "trace.h"

// Materials of hits, gathered.
struct surfaces {
    struct vec color;
    real reflectivity, shininess;
};

static struct surfaces gather(real shape, mask found, const struct model *model) {
    float id[LANES], values[5][LANES];
    unload(choose(found, shape, set(0.0f)), id);
    for (int lane = 0; lane < LANES; lane++) {
        const struct material *m = &model->materials[model->shapes[(int)id[lane]].material];
        for (int i = 0; i < 3; i++)
            values[i][lane] = (float)m->color[i];
        values[3][lane] = (float)m->reflectivity;
        values[4][lane] = (float)m->shininess;
    }
    return (struct surfaces){
        {load(values[0]), load(values[1]), load(values[2])}, load(values[3]), load(values[4])};
}

static struct vec from_to(struct place from, const double to[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(to[i], &hi[i], &lo[i]);
    return vec_scale(place_sub(from, hi, lo), set(-1.0f));
}

static struct vec light_at(struct place p, struct vec n, struct vec direction, mask found,
                           const struct surfaces *surface, const struct world *world) {
    COUNT(light_at, call);
    COUNT(light_at, scalar);
    real zero = set(0.0f);
    struct vec base = surface->color;
    struct vec to_light = from_to(p, world->view->light_position);
    real distance = vec_norm(to_light);
    to_light = vec_scale(to_light, set(1.0f) / distance);
    real facing = vec_dot(n, to_light);
    // Turned away: both terms are zero whatever the shadow. No direction to a light on the surface.
    mask lit = both(found, both(greater(facing, zero), greater(distance, zero)));
    struct vec color = vec_scale(base, set(0.01f)); // ambient
    if (!any(lit))
        return color;
    ACTIVE(count_of(lit));
    COUNT(light_at, lit);
    real reach = shadow(p, to_light, distance, lit, world) / distance;
    ACTIVE(count_of(lit));
    // Of the light's direction: minus the paper's R.
    real shine = vec_dot(vec_reflect(to_light, n), direction);
    real specular = set(0.2f) * power_of(most_of(shine, set(1e-30f)), surface->shininess);
    specular = keep(greater(shine, zero), specular);
    const double *e = world->view->light_emission;
    struct vec emission = {set((float)e[0]), set((float)e[1]), set((float)e[2])};
    struct vec bright = {mul_add(emission.x * mul_add(base.x, facing, specular), reach, color.x),
                         mul_add(emission.y * mul_add(base.y, facing, specular), reach, color.y),
                         mul_add(emission.z * mul_add(base.z, facing, specular), reach, color.z)};
    return vec_choose(lit, bright, color);
}

void trace(struct place origin, struct vec direction, mask active, int bounce,
           const struct world *world, struct shaded *result) {
    ACTIVE(count_of(active));
    COUNT(trace, call);
    const struct model *model = &world->scene->model;
    const double *b = model->background;
    struct vec background = {set((float)b[0]), set((float)b[1]), set((float)b[2])};
    *result = (struct shaded){.color = background};
    ray_march(origin, direction, active, world, &result->hit);
    mask found = result->hit.found;
    if (!any(found))
        return;
    ACTIVE(count_of(found));
    struct place p = result->hit.point;
    struct vec n = result->hit.normal;
    struct surfaces surface = gather(result->hit.shape, found, model);
    struct vec color = light_at(p, n, direction, found, &surface, world);
    ACTIVE(count_of(found));
    if (model->features.mirrors && bounce < model->march.max_bounces) {
        COUNT(trace, mirrors);
        // One reflective ray makes the call; the others are masked out of it and of its colour.
        mask mirror = both(found, greater(surface.reflectivity, set(0.0f)));
        if (any(mirror)) {
            ACTIVE(count_of(mirror));
            COUNT(trace, mirrored);
            struct place start = place_at(p, n, set((float)model->march.surface_offset), set(0.0f));
            struct shaded seen;
            trace(start, vec_reflect(direction, n), mirror, bounce + 1, world, &seen);
            real share = keep(mirror, surface.reflectivity * set(0.1f));
            color = vec_along(color, vec_choose(mirror, seen.color, color), share);
        }
    }
    ACTIVE(count_of(found));
    if (model->features.fog) {
        COUNT(trace, fog);
        real far_sq = vec_dot(p.hi, p.hi);
        color = vec_scale(color, exp_of(set((float)-model->fog) * far_sq * root(far_sq)));
    }
    result->color = vec_choose(found, color, background);
}
