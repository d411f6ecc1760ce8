// What a packet of camera rays sees where nothing waits for it, neither a shadow nor a mirror ray: coloured by itself, from
// a normal that was told where it met the shape.
#include "bounds.h"
#include "light.h"

INLINE void material_of(int i, const struct sight *seen, const struct prepared *scene,
                        struct surface *all) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    mask same = same_shape(seen->hit.shape, i);
    ACTIVE(count_of(seen->hit.found));
    COUNT(material_seen, shape);
    all->color = vec_choose(same, vec_set(s->color), all->color);
    all->shininess = choose(same, set(s->shininess), all->shininess);
    all->shine_from = choose(same, set(s->shine_from), all->shine_from);
}

INLINE void all_of(int i, const struct sight *seen, const struct prepared *scene,
                   struct surface *all) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    if (i != seen->only && !ONE_MATERIAL)
        return;
    all->color = vec_set(s->color);
    all->shininess = set(s->shininess);
    all->shine_from = set(s->shine_from);
}

static inline void material_seen(const struct sight *seen, const struct prepared *scene,
                                 struct surface *all) {
    COUNT(material_seen, call);
    if (ONE_MATERIAL) {
        all_of(0, seen, scene, all);
        return;
    }
    if (seen->only >= 0) {
        EACH_SHAPE(scene, all_of, seen, scene, all);
        return;
    }
    struct vec none = {set(0.0f), set(0.0f), set(0.0f)};
    all->color = none;
    all->shininess = all->shine_from = set(0.0f);
    EACH_HIT(seen->hit.found, seen->hit.shape, scene, material_of, seen, scene, all);
}

SHARED void color_seen(const struct sight *seen, struct stage *at, const struct convex *work) {
    ACTIVE(count_of(seen->active));
    COUNT(color_seen, call);
    const struct known *scene = KNOWN(work->scene);
    at->hit.found = seen->hit.found;
    at->hit.t = seen->hit.t;
    at->hit.shape = seen->hit.shape;
    mask far = both(at->hit.found, greater(at->hit.t, set(work->inside)));
    if (scene->model.features.fog || any(far)) {
        COUNT(color_seen, point);
        at->point = vec_along(at->ray.origin, at->ray.direction, at->hit.t);
        if (any(far)) {
            COUNT(color_seen, far);
            COUNT(color_seen, far_scalar);
            at->hit.found = both(at->hit.found, in_bounds(at, scene));
        }
    }
    at->color = background(set(1.0f), &scene->model);
    if (!any(at->hit.found))
        return;
    ACTIVE(count_of(at->hit.found));
    COUNT(color_seen, hit);
    at->surface.normal = seen->hit.local;
    material_seen(seen, work->scene, &at->surface);
    light_seen(at, &at->surface, work);
    at->color.x = at->color.x + keep(at->lit, at->light.x);
    at->color.y = at->color.y + keep(at->lit, at->light.y);
    at->color.z = at->color.z + keep(at->lit, at->light.z);
}
