// Which shapes can darken the shadow rays of a packet, and where its march may begin and end.
#include "repetition/repeated_rays.h"
#include "shadow/shadow_cone.h"
#include "types/tile_context.h"

KERNEL_INLINE void candidate_plane(const struct primitive *s, int i, struct shadow_rays *r,
                                   const struct tile_context *work,
                                   struct shadow_candidate *candidate) {
    float q = KNOWN(work->scene)->lit_slope;
    vmask self = is_shape(r->shape, i);
    vfloat height = v_zero_where(self, height_over(s, r->point)),
           slope = add_dot(s->normal, r->to_light);
    candidate->origin.x = height;
    candidate->direction.x = slope;
    vmask clear = v_or(self, plane_clears(height, slope, q, KNOWN(work->scene)));
    r->end = v_select(clear, r->end, v_splat(INFINITY));
    candidate->from = height / v_max(v_splat(1.0f) - slope, v_splat(1e-6f));
    r->leap_limit = v_select(self, r->leap_limit, v_min(r->leap_limit, candidate->from));
    r->meets_many = v_or(r->meets_many, v_not(clear));
    if (v_any(v_andnot(clear, r->active))) {
        vfloat t = height / (v_splat(0.0f) - slope);
        vmask met = v_and(v_andnot(self, r->active),
                          v_and(v_cmp_lt(slope, v_splat(0.0f)), v_cmp_lt(t, r->first)));
        r->first = v_select(met, t, r->first);
        r->cosine = v_select(met, v_splat(0.0f) - slope, r->cosine);
    }
}

KERNEL_INLINE void first_entry(const struct primitive *s, int i, struct shadow_rays *r, vmask met) {
    vmask self = is_shape(r->shape, i);
    struct vec at, o = vec_select(self, r->local, to_local(s, r->point)),
                   d = turned(s, r->to_light);
    vfloat t;
    vmask behind, in = enter(o, d, s, v_andnot(self, met), &t, &at, &behind);
    in = v_and(in, v_cmp_lt(t, r->first));
    if (v_any(in)) {
        r->first = v_select(in, t, r->first);
        r->cosine = v_select(in, entry_cosine(at, d, s, r), r->cosine);
    }
}

// Sets candidate->from of solid i, and updates end, leap limit and first entry of the rays.
INLINE void candidate_solid(const struct primitive *s, int i, struct shadow_rays *r,
                            const struct tile_context *work, struct shadow_candidate *candidate) {
    float q = lit_slope_for(s, KNOWN(work->scene)->lit_slope);
    float share = share_of(s);
    vfloat zero = v_splat(0.0f);
    vmask self = is_shape(r->shape, i);
    struct shadow_cone cone = shadow_cone_to(to_centre(s, r->point), r->to_light, s, q);
    vmask self_bulge = v_and(self, convex_from(s, r->local, r->facing, KNOWN(work->scene)));
    vmask met = v_andnot(v_or(cone_misses(cone, q), self_bulge), r->active);
    r->end = v_select(met, v_max(cone_exit(cone, q), r->end), r->end);
    // As long as |v − t·l| ≥ R + t, h ≥ t. Another shape is nearer there, because h is 0 at t = 0.
    vfloat towards = cone.along + v_splat(s->bound);
    vfloat from = v_select(v_cmp_gt(towards, zero),
                           cone.c / v_max(towards + towards, v_splat(1e-20f)), v_splat(INFINITY));
    if (share < 1) {
        r->meets_many = v_or(r->meets_many, met);
        from = v_splat(share / (1 + share)) *
               (v_sqrt(cone.c + v_splat(s->bound_sq)) - v_splat(s->bound));
    }
    // A ray from a plane marches at height facing·t or less. The shape is nearer only inside a cone of that
    // slope.
    vfloat s_slope = r->facing / v_splat(share);
    vfloat b = v_madd(s_slope, v_splat(s->bound), cone.along),
           a = v_nmadd(s_slope, s_slope, v_splat(1.0f));
    vfloat discriminant = v_msub(b, b, a * cone.c);
    vfloat meets = cone.c / (b + v_sqrt(v_max(discriminant, zero)));
    meets =
        v_select(v_and(v_cmp_gt(b, zero), v_cmp_ge(discriminant, zero)), meets, v_splat(INFINITY));
    from = v_select(
        v_and(v_and(r->on_plane, v_cmp_lt(s_slope, v_splat(0.99f))), v_cmp_gt(cone.c, zero)), meets,
        from);
    from = v_zero_where(self, v_max(from, zero));
    candidate->from = from;
    r->leap_limit = v_min(r->leap_limit, from);
    if (v_any(met) && s->type != SHAPE_MANDELBULB && !IS_GROUP(s))
        first_entry(s, i, r, met);
}

// As first_entry() for a repeated shape.
INLINE void first_entry_in_cells(const struct primitive *s, int i, struct shadow_rays *r,
                                 const struct limits *limits) {
    vmask self = is_shape(r->shape, i);
    struct vec at, o = vec_select(self, r->local, to_local(s, r->point));
    vfloat t, end = v_min(r->first, bounds_distance(r->point, r->to_light, limits));
    vmask in = shadow_enters_cells(s, o, r->to_light, self, r->active, end, &t, &at);
    in = v_and(in, v_cmp_lt(t, r->first));
    if (v_any(in)) {
        r->first = v_select(in, t, r->first);
        r->cosine = v_select(in, entry_cosine(at, turned(s, r->to_light), s, r), r->cosine);
    }
}

// Repeated shapes: a copy may be the nearest anywhere and bring any term below 1.
INLINE void candidate_cells(const struct primitive *s, int i, struct shadow_rays *r,
                            const struct tile_context *work, struct shadow_candidate *candidate) {
    candidate->from = r->leap_limit = v_splat(0.0f);
    r->end = v_splat(INFINITY);
    first_entry_in_cells(s, i, r, &work->scene->model.march);
}

KERNEL_INLINE void set_candidate_ray(const struct shadow_rays *r, int i,
                                     struct shadow_candidate *candidate,
                                     const struct tile_context *work) {
    const struct known_scene *scene = KNOWN(work->scene);
    const struct primitive *s = &scene->primitives[i];
    candidate->wake_bound = v_splat(-INFINITY);
    if (s->eval == EVAL_LINEAR)
        return;
    if (r->from_planes) {
        candidate->origin = to_local(s, r->point);
        candidate->direction = turned(s, r->to_light);
        candidate->power = false;
        return;
    }
    vmask self = is_shape(r->shape, i);
    candidate->origin = vec_select(self, r->local, to_local(s, r->point));
    candidate->direction = turned(s, r->to_light);
    candidate->power =
        s->type == SHAPE_SPHERE && v_any(v_and(self, r->active)) && !REPEATED(s) && !scene->bulbs;
    if (candidate->power) {
        candidate->constant = v_zero_where(self, vec_dot(candidate->origin, candidate->origin) -
                                                     v_splat(s->bound_sq));
        candidate->slope = v_splat(2.0f) * vec_dot(candidate->origin, candidate->direction);
    }
}

// As candidate_solid() for a packet whose rays all start on planes.
INLINE void candidate_solid_from_plane(const struct primitive *s, struct shadow_rays *r,
                                       const struct known_scene *scene,
                                       struct shadow_candidate *candidate) {
    float q = scene->lit_slope;
    vfloat zero = v_splat(0.0f);
    struct shadow_cone cone = shadow_cone_to(to_centre(s, r->point), r->to_light, s, q);
    vmask met = v_andnot(cone_misses(cone, q), r->active);
    // The march is at height facing·t or less. The solid is nearer only inside a cone of that slope.
    vfloat b = v_madd(r->facing, v_splat(s->bound), cone.along);
    vfloat a = v_nmadd(r->facing, r->facing, v_splat(1.0f));
    vfloat discriminant = v_msub(b, b, a * cone.c);
    vfloat from = cone.c / (b + v_sqrt(v_max(discriminant, zero)));
    from =
        v_select(v_and(v_cmp_gt(b, zero), v_cmp_ge(discriminant, zero)), from, v_splat(INFINITY));
    candidate->from = v_max(from, zero);
    r->leap_limit = v_min(r->leap_limit, candidate->from);
    if (!v_any(met))
        return;
    r->meets_many = v_or(r->meets_many, s->convex ? v_and(r->meets_one, met) : met);
    r->meets_one = v_or(r->meets_one, met);
    r->end = v_select(met, v_max(cone_exit(cone, q), r->end), r->end);
    if (IS_GROUP(s))
        return;
    struct vec at, d = turned(s, r->to_light);
    vfloat t;
    vmask behind, in = enter(to_local(s, r->point), d, s, met, &t, &at, &behind);
    in = v_and(in, v_cmp_lt(t, r->first));
    if (v_any(in)) {
        r->first = v_select(in, t, r->first);
        r->cosine = v_select(in, entry_cosine(at, d, s, r), r->cosine);
    }
}

INLINE void mark_rays_from_planes(int i, struct shadow_rays *r, const struct known_scene *scene) {
    if (scene->primitives[i].eval == EVAL_LINEAR)
        r->on_plane = v_or(r->on_plane, is_shape(r->shape, i));
}

INLINE void set_candidate(int i, struct shadow_rays *r, const struct tile_context *work,
                          struct shadow_candidate *candidates) {
    const struct primitive *s = &KNOWN(work->scene)->primitives[i];
    if (s->eval == EVAL_LINEAR)
        candidate_plane(s, i, r, work, &candidates[i]);
    else if (REPEATED(s))
        candidate_cells(s, i, r, work, &candidates[i]);
    else if (r->from_planes && share_of(s) == 1)
        candidate_solid_from_plane(s, r, KNOWN(work->scene), &candidates[i]);
    else
        candidate_solid(s, i, r, work, &candidates[i]);
}

// Lists shape i if it can be the nearest before some ray's end.
INLINE void keep_candidate(int i, struct shadow_rays *r, const struct tile_context *work,
                           struct shadow_candidate *candidates, struct shape_set *listed) {
    const struct known_scene *scene = KNOWN(work->scene);
    struct shadow_candidate *candidate = &candidates[i];
    if (!scene->bulbs && !v_any(v_and(r->active, v_cmp_lt(candidate->from, r->end))))
        return;
    add_to_set(listed, i);
    set_candidate_ray(r, i, candidate, work);
}

void list_candidates(struct shadow_rays *restrict r, struct shadow_candidate *restrict candidates,
                     struct shape_set *restrict listed, const struct tile_context *work) {
    const struct known_scene *scene = KNOWN(work->scene);
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
        mark_rays_from_planes(i, r, scene);
    r->from_planes = !v_any(v_andnot(r->on_plane, r->active));
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
        set_candidate(i, r, work, candidates);
    clear_set(listed);
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
        keep_candidate(i, r, work, candidates, listed);
}
