// Which shapes a packet of shadow rays can meet, where its march may begin and end, and what it is blocked by.
// A cone of slope q about the ray meets a sphere where narrow·t² − 2·lean·t + need = 0, narrow = 1 − q² (`wide`,
// `narrow_part`), lean = v·l + q·R, need = |v|² − R², v from the ray's origin to the centre; `rest` = lean² − narrow·need.
#include "cells.h"

KNOWN_SHARED void look_at_plane(const struct placed *s, int i, struct rays *r,
                                const struct convex *work, struct near *near) {
    COUNT(look_at_plane, call);
    COUNT(look_at_plane, scalar);
    float q = KNOWN(work->scene)->lit_slope;
    mask own = same_shape(r->shape, i);
    real height = drop(own, height_over(s, r->point)), slope = dot_with(s->normal, r->to_light);
    near->origin.x = height;
    near->direction.x = slope;
    mask clear = either(own, plane_clears(height, slope, q, KNOWN(work->scene)));
    r->end = choose(clear, r->end, set(INFINITY));
    near->from = height / most_of(set(1.0f) - slope, set(1e-6f));
    r->alone = choose(own, r->alone, least_of(r->alone, near->from));
    r->many = either(r->many, not_in(clear));
    if (any(but_not(clear, r->active))) {
        COUNT(look_at_plane, met);
        real t = height / (set(0.0f) - slope);
        mask met = both(but_not(own, r->active), both(less(slope, set(0.0f)), less(t, r->first)));
        r->first = choose(met, t, r->first);
        r->cosine = choose(met, set(0.0f) - slope, r->cosine);
    }
}

KNOWN_SHARED void enter_on_the_way(const struct placed *s, int i, struct rays *r, mask met) {
    COUNT(enter_on_the_way, call);
    mask own = same_shape(r->shape, i);
    struct vec at, o = vec_choose(own, r->local, in_frame(s, r->point)), d = turned(s, r->to_light);
    real t;
    mask behind, in = enter(o, d, s, but_not(own, met), &t, &at, &behind);
    in = both(in, less(t, r->first));
    if (any(in)) {
        COUNT(enter_on_the_way, in);
        r->first = choose(in, t, r->first);
        r->cosine = choose(in, slant_at(at, d, s, r), r->cosine);
    }
}

INLINE void look_at_solid(const struct placed *s, int i, struct rays *r, const struct convex *work,
                          struct near *near) {
    COUNT(look_at_solid, call);
    COUNT(look_at_solid, scalar);
    float q = slope_to(s, KNOWN(work->scene)->lit_slope);
    bool bulb = s->type == SHAPE_MANDELBULB;
    real zero = set(0.0f);
    mask own = same_shape(r->shape, i);
    struct cone c = cone_to(to_centre(s, r->point), r->to_light, s, q);
    mask own_bulge = both(own, bulges(s, r->local, r->facing, KNOWN(work->scene)));
    mask met = but_not(either(cone_misses(c, q), own_bulge), r->active);
    r->end = choose(met, most_of(cone_leaves(c, q), r->end), r->end);
    // h ≥ t as long as |v − t·l| ≥ R + t: until then something else is nearer, for h is 0 at t = 0.
    real towards = c.along + set(s->bound);
    real from = choose(greater(towards, zero), c.need / most_of(towards + towards, set(1e-20f)),
                       set(INFINITY));
    if (bulb) {
        COUNT(look_at_solid, bulb);
        from =
            set(BULB_SHARE / (1 + BULB_SHARE)) * (root(c.need + set(s->bound_sq)) - set(s->bound));
    }
    // From a plane the march is at most at height facing·t: a cone once more, of that slope.
    real share = set(bulb ? BULB_SHARE : 1.0f), s_slope = r->facing / share;
    real lean = mul_add(s_slope, set(s->bound), c.along),
         narrow_part = neg_mul_add(s_slope, s_slope, set(1.0f));
    real rest = mul_sub(lean, lean, narrow_part * c.need);
    real meets = c.need / (lean + root(most_of(rest, zero)));
    meets = choose(both(greater(lean, zero), not_less(rest, zero)), meets, set(INFINITY));
    from = choose(both(both(r->on_plane, less(s_slope, set(0.99f))), greater(c.need, zero)), meets,
                  from);
    from = drop(own, most_of(from, zero));
    near->from = from;
    r->alone = least_of(r->alone, from);
    if (any(met) && !bulb)
        enter_on_the_way(s, i, r, met);
}

// A copy may be the nearest anywhere, and bring the term of any step below 1.
INLINE void look_at_cells(const struct placed *s, int i, struct rays *r, const struct convex *work,
                          struct near *near) {
    near->from = r->alone = set(0.0f);
    r->end = set(INFINITY);
    cells_on_the_way(s, i, r, &work->scene->model.march);
}

KNOWN_SHARED void see_along(const struct rays *r, int i, struct near *near,
                            const struct convex *work) {
    COUNT(see_along, call);
    const struct known *scene = KNOWN(work->scene);
    const struct placed *s = &scene->placed[i];
    near->wakes = set(-INFINITY);
    if (s->way == LINEAR)
        return;
    if (r->floor) {
        COUNT(see_along, floor);
        near->origin = in_frame(s, r->point);
        near->direction = turned(s, r->to_light);
        near->power = false;
        return;
    }
    COUNT(see_along, solid);
    mask own = same_shape(r->shape, i);
    near->origin = vec_choose(own, r->local, in_frame(s, r->point));
    near->direction = turned(s, r->to_light);
    near->power =
        s->type == SHAPE_SPHERE && any(both(own, r->active)) && !REPEATED(s) && !scene->bulbs;
    if (near->power) {
        COUNT(see_along, power);
        near->constant = drop(own, vec_dot(near->origin, near->origin) - set(s->bound_sq));
        near->slope = set(2.0f) * vec_dot(near->origin, near->direction);
    }
}

// Of rays that all come from one plane, so that no solid is their own.
INLINE void look_from_plane(const struct placed *s, struct rays *r, const struct known *scene,
                            struct near *near) {
    COUNT(look_from_plane, call);
    COUNT(look_from_plane, scalar);
    float q = scene->lit_slope;
    real zero = set(0.0f);
    struct cone c = cone_to(to_centre(s, r->point), r->to_light, s, q);
    mask met = but_not(cone_misses(c, q), r->active);
    // The march is at most at height facing·t: a cone once more, of that slope.
    real lean = mul_add(r->facing, set(s->bound), c.along);
    real narrow_part = neg_mul_add(r->facing, r->facing, set(1.0f));
    real rest = mul_sub(lean, lean, narrow_part * c.need);
    real from = c.need / (lean + root(most_of(rest, zero)));
    from = choose(both(greater(lean, zero), not_less(rest, zero)), from, set(INFINITY));
    near->from = most_of(from, zero);
    r->alone = least_of(r->alone, near->from);
    if (!any(met))
        return;
    COUNT(look_from_plane, met);
    r->many = either(r->many, s->convex ? both(r->some, met) : met);
    r->some = either(r->some, met);
    r->end = choose(met, most_of(cone_leaves(c, q), r->end), r->end);
    struct vec at, d = turned(s, r->to_light);
    real t;
    mask behind, in = enter(in_frame(s, r->point), d, s, met, &t, &at, &behind);
    in = both(in, less(t, r->first));
    if (any(in)) {
        COUNT(look_from_plane, in);
        r->first = choose(in, t, r->first);
        r->cosine = choose(in, slant_at(at, d, s, r), r->cosine);
    }
}

INLINE void look_from(int i, struct rays *r, const struct known *scene) {
    if (scene->placed[i].way == LINEAR) {
        COUNT(choose_shapes, plane);
        r->on_plane = either(r->on_plane, same_shape(r->shape, i));
    }
}

INLINE void look_at(int i, struct rays *r, const struct convex *work, struct near *nears) {
    const struct placed *s = &KNOWN(work->scene)->placed[i];
    if (s->way == LINEAR)
        look_at_plane(s, i, r, work, &nears[i]);
    else if (REPEATED(s))
        look_at_cells(s, i, r, work, &nears[i]);
    else if (r->floor && s->type != SHAPE_MANDELBULB)
        look_from_plane(s, r, KNOWN(work->scene), &nears[i]);
    else
        look_at_solid(s, i, r, work, &nears[i]);
}

INLINE void choose_shape(int i, struct rays *r, const struct convex *work, struct near *nears,
                         struct shapes *casters) {
    const struct known *scene = KNOWN(work->scene);
    struct near *near = &nears[i];
    COUNT(choose_shapes, shape);
    if (!scene->bulbs && !any(both(r->active, less(near->from, r->end))))
        return;
    put_in(casters, i);
    see_along(r, i, near, work);
}

void choose_shapes(struct rays *restrict r, struct near *restrict nears,
                   struct shapes *restrict casters, const struct convex *work) {
    const struct known *scene = KNOWN(work->scene);
    COUNT(choose_shapes, call);
    EACH_SHAPE(work->scene, look_from, r, scene);
    r->floor = !any(but_not(r->on_plane, r->active));
    EACH_SHAPE(work->scene, look_at, r, work, nears);
    none_of(casters);
    EACH_SHAPE(work->scene, choose_shape, r, work, nears, casters);
}
