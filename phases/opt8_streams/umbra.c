// Shadow rays that wait, in packets: see streams.h. Each of them marches until its last ray is done.
#include "streams.h"

// Rays to the light.
struct shade {
    real least, twice_previous;
    struct exit exit;
};

// The rays that are still under way, after some have ended.
__attribute__((noinline)) static bool shade_ends(int k, mask live, struct group *group) {
    group->live[k] = live;
    group->high[k] = choose(live, group->high[k], set(-INFINITY));
    return any(live);
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds. False after the
// packet's last step.
static inline bool soft_step(struct shade *ray, int k, float strength_sq, struct group *group,
                             const struct model *model) {
    mask live = group->live[k];
    ACTIVE(count_of(live));
    COUNT(soft_step, call);
    real t = group->t[k], h = group->distance[k], zero = set(0.0f);
    mask going = not_less_in(live, h, least_step(t, set((float)model->march.hit_distance)));
    if (!any(going))
        return shade_ends(k, going, group);
    ACTIVE(count_of(going));
    COUNT(soft_step, step);
    // y = h²/(2·previous); inside = h² − y², past = t − y. Asked without a division: both times 2·previous.
    real twice = ray->twice_previous;
    real square = h * h, scale = twice * twice, inside = scale - square;
    real past = mul_sub(twice, t, square);
    // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
    // In float it is noise wherever inside/h² is of the order of h's own error, 1e-5 at least.
    mask sound = less_in(less_in(going, scale * set(2e-5f), inside), zero, past);
    // strength·√inside/past < least, asked without the root: it is seldom so.
    real wanted = ray->least * past;
    mask darker = less_in(sound, set(strength_sq) * square * inside, wanted * wanted);
    if (any(darker)) {
        ACTIVE(count_of(darker));
        COUNT(soft_step, darker);
        ray->least = choose(darker, set((float)model->shadow_strength) * h * root(inside) / past,
                            ray->least);
    }
    ray->twice_previous = h + h;
    group->t[k] = t = add_where(going, t, h);
    mask on = not_greater_in(going, beyond(ray->exit, t), zero);
    return same(on, live) || shade_ends(k, on, group);
}

static inline bool hard_step(struct shade *ray, real distance, int k, struct group *group,
                             const struct model *model) {
    // Past the light a ray is lit, and has taken one evaluation too many.
    ACTIVE(count_of(group->live[k]));
    COUNT(hard_step, call);
    real t = group->t[k], h = group->distance[k];
    mask live = group->live[k], before = less_in(live, t, distance);
    mask going = not_less_in(before, h, least_step(t, set((float)model->march.hit_distance)));
    ray->least = drop(but_not(going, before), ray->least);
    group->t[k] = t = add_where(going, t, h);
    mask on = not_greater_in(going, beyond(ray->exit, t), set(0.0f));
    return same(on, live) || shade_ends(k, on, group);
}

static void wait_for(struct rays *rays, real length[GROUP], int first, struct desk *desk) {
    COUNT(wait_for, call);
    float (*field)[ROOM] = desk->shadow;
    for (int k = 0; k < GROUP; k++, first += LANES) {
        rays->origin[k] =
            (struct place){load_vec(field + S_HI, first), load_vec(field + S_LO, first)};
        rays->direction[k] = load_vec(field + S_TO_LIGHT, first);
        COUNT(wait_for, packet);
        rays->active[k] = lanes_before(desk->shadows - first);
        length[k] = load(&field[S_DISTANCE][first]);
    }
}

// 1: the light reaches the point, 0: it does not; between, the penumbra of a soft shadow.
static void shadow(const struct rays *rays, const real length[GROUP], struct world *world,
                   real reach[GROUP]) {
    COUNT(shadow, call);
    COUNT(shadow, scalar);
    const struct prepared *scene = world->scene;
    const struct model *model = &scene->model;
    float strength = (float)model->shadow_strength, strength_sq = strength * strength;
    struct group *group = &world->group;
    bool soft = model->shadows == SHADOWS_SOFT;
    struct shade shades[GROUP];
    meet(rays, soft ? NULL : length, soft ? UNION : HIT, world, world->own->shadow);
    for (int k = 0; k < GROUP; k++) {
        shades[k].least = set(1.0f);
        group->live[k] = rays->active[k];
        if (any(rays->active[k]))
            approach_origins(rays->origin[k], scene, &group->beam[k]);
    }
    set_out(group);
    for (int i = 0; i < group->count; i++) {
        int k = group->list[i];
        ACTIVE(count_of(rays->active[k]));
        approach_directions(rays->direction[k], scene, &group->beam[k]);
        shades[k].exit = leaving(rays->origin[k], rays->direction[k], model);
        shades[k].twice_previous =
            set(1e14f); // its square, times t's and the strength's, is a float
        group->t[k] = set((float)model->march.surface_offset);
    }
    for (int step = 0; group->count > 0 && step < model->march.max_steps; step++) {
        scene_distances(group, scene);
        for (int i = 0; i < group->count;) {
            int k = group->list[i];
            if (soft ? soft_step(&shades[k], k, strength_sq, group, model)
                     : hard_step(&shades[k], length[k], k, group, model))
                i++;
            else
                group->list[i] = group->list[--group->count];
        }
    }
    for (int k = 0; k < GROUP; k++)
        reach[k] = shades[k].least;
}

void cast_shadows(struct world *world) {
    COUNT(cast_shadows, call);
    struct desk *desk = world->desk;
    for (int first = 0; first < desk->shadows; first += TOGETHER) {
        struct rays rays;
        real length[GROUP], reach[GROUP];
        wait_for(&rays, length, first, desk);
        shadow(&rays, length, world, reach);
        for (int k = 0; k < GROUP; k++) {
            int at = first + k * LANES;
            ACTIVE(count_of(rays.active[k]));
            COUNT(cast_shadows, packet);
            struct vec light = vec_scale(load_vec(desk->shadow + S_LIGHT, at), reach[k]);
            add_light(rays.active[k], light, load(&desk->shadow[S_PIXEL][at]), desk);
        }
    }
    desk->shadows = 0;
}
