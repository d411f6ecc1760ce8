// A step of a shadow ray: of whole packets (umbra.c), and of lanes that are filled again (stretch.c).
#ifndef OPT8_UMBRA_H
#define OPT8_UMBRA_H

#include "streams.h"

struct shade {
    real least_sq; // of the light so far: the root is taken once, of what is left in the end
    real twice_previous;
    struct exit exit;
};

// The rays that are still under way, after some have ended.
__attribute__((noinline, unused)) static bool shade_ends(int k, mask live, struct group *group) {
    group->live[k] = live;
    group->high[k] = choose(live, group->high[k], set(-INFINITY));
    return any(live);
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. Runs past the light to the bounds. Which rays are still under way after
// this step: of those that are not, the shade stays as it is.
static inline mask soft_step(struct shade *ray, int k, float strength_sq, struct group *group,
                             const struct model *model) {
    mask live = group->live[k];
    ACTIVE(count_of(live));
    COUNT(soft_step, call);
    real t = group->t[k], h = group->distance[k], zero = set(0.0f);
    mask going = not_less_in(live, h, least_step(t, set((float)model->march.hit_distance)));
    if (!any(going))
        return going;
    ACTIVE(count_of(going));
    COUNT(soft_step, step);
    // y = h²/(2·previous); inside = h² − y², past = t − y. Asked without a division: both times 2·previous.
    real twice = ray->twice_previous;
    real square = h * h, scale = twice * twice, inside = scale - square;
    real past = mul_sub(twice, t, square);
    // 0/0 when moving straight away from a surface (h = 2·previous): such a term says nothing.
    // In float it is noise wherever inside/h² is of the order of h's own error, 1e-5 at least.
    mask sound = less_in(less_in(going, scale * set(2e-5f), inside), zero, past);
    // (strength·h·√inside/past)² < least², asked without the division: it is seldom so.
    real term = set(strength_sq) * square * inside, per = past * past;
    mask darker = less_in(sound, term, ray->least_sq * per);
    if (any(darker)) {
        ACTIVE(count_of(darker));
        COUNT(soft_step, darker);
        ray->least_sq = choose(darker, term / past / past, ray->least_sq); // past² may overflow
    }
    ray->twice_previous = choose(going, h + h, twice);
    group->t[k] = t = add_where(going, t, h);
    return not_greater_in(going, beyond(ray->exit, t), zero);
}

static inline mask hard_step(struct shade *ray, real distance, int k, struct group *group,
                             const struct model *model) {
    // Past the light a ray is lit, and has taken one evaluation too many.
    ACTIVE(count_of(group->live[k]));
    COUNT(hard_step, call);
    real t = group->t[k], h = group->distance[k];
    mask live = group->live[k], before = less_in(live, t, distance);
    mask going = not_less_in(before, h, least_step(t, set((float)model->march.hit_distance)));
    ray->least_sq = drop(but_not(going, before), ray->least_sq);
    group->t[k] = t = add_where(going, t, h);
    return not_greater_in(going, beyond(ray->exit, t), set(0.0f));
}

#endif
