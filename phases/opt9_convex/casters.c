// Which shapes a packet of shadow rays can meet, where its march may begin and end, and what it is blocked by.
// A cone of slope q about the ray meets a sphere where narrow·t² − 2·lean·t + need = 0, narrow = 1 − q² (`wide`,
// `narrow_part`), lean = v·l + q·R, need = |v|² − R², v from the ray's origin to the centre; `rest` = lean² − narrow·need.
#include "cells.h"

KNOWN_SHARED void look_at_plane(const struct placed *s, int i, struct rays *r,
                                const struct convex *work, struct near *near) {
    COUNT(look_at_plane, call);
    COUNT(look_at_plane, scalar);
    float q = KNOWN(work->scene)->lit_slope;
    vmask own = same_shape(r->shape, i);
    vfloat height = v_zero_where(own, height_over(s, r->point)),
           slope = dot_with(s->normal, r->to_light);
    near->origin.x = height;
    near->direction.x = slope;
    vmask clear = v_or(own, plane_clears(height, slope, q, KNOWN(work->scene)));
    r->end = v_select(clear, r->end, v_splat(INFINITY));
    near->from = height / v_max(v_splat(1.0f) - slope, v_splat(1e-6f));
    r->alone = v_select(own, r->alone, v_min(r->alone, near->from));
    r->many = v_or(r->many, v_not(clear));
    if (v_any(v_andnot(clear, r->active))) {
        COUNT(look_at_plane, met);
        vfloat t = height / (v_splat(0.0f) - slope);
        vmask met = v_and(v_andnot(own, r->active),
                          v_and(v_cmp_lt(slope, v_splat(0.0f)), v_cmp_lt(t, r->first)));
        r->first = v_select(met, t, r->first);
        r->cosine = v_select(met, v_splat(0.0f) - slope, r->cosine);
    }
}

KNOWN_SHARED void enter_on_the_way(const struct placed *s, int i, struct rays *r, vmask met) {
    COUNT(enter_on_the_way, call);
    vmask own = same_shape(r->shape, i);
    struct vec at, o = vec_select(own, r->local, in_frame(s, r->point)), d = turned(s, r->to_light);
    vfloat t;
    vmask behind, in = enter(o, d, s, v_andnot(own, met), &t, &at, &behind);
    in = v_and(in, v_cmp_lt(t, r->first));
    if (v_any(in)) {
        COUNT(enter_on_the_way, in);
        r->first = v_select(in, t, r->first);
        r->cosine = v_select(in, slant_at(at, d, s, r), r->cosine);
    }
}

INLINE void look_at_solid(const struct placed *s, int i, struct rays *r, const struct convex *work,
                          struct near *near) {
    COUNT(look_at_solid, call);
    COUNT(look_at_solid, scalar);
    float q = slope_to(s, KNOWN(work->scene)->lit_slope);
    bool bulb = s->type == SHAPE_MANDELBULB;
    vfloat zero = v_splat(0.0f);
    vmask own = same_shape(r->shape, i);
    struct cone c = cone_to(to_centre(s, r->point), r->to_light, s, q);
    vmask own_bulge = v_and(own, bulges(s, r->local, r->facing, KNOWN(work->scene)));
    vmask met = v_andnot(v_or(cone_misses(c, q), own_bulge), r->active);
    r->end = v_select(met, v_max(cone_leaves(c, q), r->end), r->end);
    // h ≥ t as long as |v − t·l| ≥ R + t: until then something else is nearer, for h is 0 at t = 0.
    vfloat towards = c.along + v_splat(s->bound);
    vfloat from = v_select(v_cmp_gt(towards, zero),
                           c.need / v_max(towards + towards, v_splat(1e-20f)), v_splat(INFINITY));
    if (bulb) {
        COUNT(look_at_solid, bulb);
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
    from = v_zero_where(own, v_max(from, zero));
    near->from = from;
    r->alone = v_min(r->alone, from);
    if (v_any(met) && !bulb)
        enter_on_the_way(s, i, r, met);
}

// A copy may be the nearest anywhere, and bring the term of any step below 1.
INLINE void look_at_cells(const struct placed *s, int i, struct rays *r, const struct convex *work,
                          struct near *near) {
    near->from = r->alone = v_splat(0.0f);
    r->end = v_splat(INFINITY);
    cells_on_the_way(s, i, r, &work->scene->model.march);
}

KNOWN_SHARED void see_along(const struct rays *r, int i, struct near *near,
                            const struct convex *work) {
    COUNT(see_along, call);
    const struct known *scene = KNOWN(work->scene);
    const struct placed *s = &scene->placed[i];
    near->wakes = v_splat(-INFINITY);
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
    vmask own = same_shape(r->shape, i);
    near->origin = vec_select(own, r->local, in_frame(s, r->point));
    near->direction = turned(s, r->to_light);
    near->power =
        s->type == SHAPE_SPHERE && v_any(v_and(own, r->active)) && !REPEATED(s) && !scene->bulbs;
    if (near->power) {
        COUNT(see_along, power);
        near->constant =
            v_zero_where(own, vec_dot(near->origin, near->origin) - v_splat(s->bound_sq));
        near->slope = v_splat(2.0f) * vec_dot(near->origin, near->direction);
    }
}

// Of rays that all come from one plane, so that no solid is their own.
INLINE void look_from_plane(const struct placed *s, struct rays *r, const struct known *scene,
                            struct near *near) {
    COUNT(look_from_plane, call);
    COUNT(look_from_plane, scalar);
    float q = scene->lit_slope;
    vfloat zero = v_splat(0.0f);
    struct cone c = cone_to(to_centre(s, r->point), r->to_light, s, q);
    vmask met = v_andnot(cone_misses(c, q), r->active);
    // The march is at most at height facing·t: a cone once more, of that slope.
    vfloat lean = v_madd(r->facing, v_splat(s->bound), c.along);
    vfloat narrow_part = v_nmadd(r->facing, r->facing, v_splat(1.0f));
    vfloat rest = v_msub(lean, lean, narrow_part * c.need);
    vfloat from = c.need / (lean + v_sqrt(v_max(rest, zero)));
    from = v_select(v_and(v_cmp_gt(lean, zero), v_cmp_ge(rest, zero)), from, v_splat(INFINITY));
    near->from = v_max(from, zero);
    r->alone = v_min(r->alone, near->from);
    if (!v_any(met))
        return;
    COUNT(look_from_plane, met);
    r->many = v_or(r->many, s->convex ? v_and(r->some, met) : met);
    r->some = v_or(r->some, met);
    r->end = v_select(met, v_max(cone_leaves(c, q), r->end), r->end);
    struct vec at, d = turned(s, r->to_light);
    vfloat t;
    vmask behind, in = enter(in_frame(s, r->point), d, s, met, &t, &at, &behind);
    in = v_and(in, v_cmp_lt(t, r->first));
    if (v_any(in)) {
        COUNT(look_from_plane, in);
        r->first = v_select(in, t, r->first);
        r->cosine = v_select(in, slant_at(at, d, s, r), r->cosine);
    }
}

INLINE void look_from(int i, struct rays *r, const struct known *scene) {
    if (scene->placed[i].way == LINEAR) {
        COUNT(choose_shapes, plane);
        r->on_plane = v_or(r->on_plane, same_shape(r->shape, i));
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
    if (!scene->bulbs && !v_any(v_and(r->active, v_cmp_lt(near->from, r->end))))
        return;
    put_in(casters, i);
    see_along(r, i, near, work);
}

void choose_shapes(struct rays *restrict r, struct near *restrict nears,
                   struct shapes *restrict casters, const struct convex *work) {
    const struct known *scene = KNOWN(work->scene);
    COUNT(choose_shapes, call);
    EACH_SHAPE(work->scene, look_from, r, scene);
    r->floor = !v_any(v_andnot(r->on_plane, r->active));
    EACH_SHAPE(work->scene, look_at, r, work, nears);
    none_of(casters);
    EACH_SHAPE(work->scene, choose_shape, r, work, nears, casters);
}
