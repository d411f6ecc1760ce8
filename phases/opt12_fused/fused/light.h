// Light at the hits of packets on one shape (B. T. Phong, CACM 18 (1975)) and the share of it that solids and planes
// leave: the arithmetic of frame/lighting.h and shadow/soft_shadow.c, without a queue between them.
#pragma once

// Rays towards the light.
struct light_rays {
    struct vec p, l;
    vfloat far;
    vmask active;
};

// l, per: towards the light and the inverse of its length, far.
INLINE void set_light_rays(struct light_rays *rays, struct vec p, struct vec l, vfloat per,
                           vfloat far, vmask active) {
    rays->p = p;
    rays->l = vec_scale(l, per);
    rays->far = far;
    rays->active = active;
}

INLINE vfloat near_of_rays(void) {
    return v_splat((float)scene_known.model.march.surface_offset);
}

INLINE vfloat room_of_scene(void) {
    return v_splat(room_for((float)scene_known.model.shadow_strength));
}

// Returns the rays whose cone of slope `best` meets the bounding sphere of s.
INLINE vmask cone_meets(const struct primitive *s, struct vec to, const struct light_rays *rays,
                        vfloat best) {
    vfloat along = vec_dot(to, rays->l), c = vec_dot(to, to) - v_splat(s->bound_sq);
    vfloat b = v_max(v_madd(best, v_splat(s->bound), along), v_splat(0.0f));
    vfloat narrow = v_nmadd(best, best, v_splat(1.0f));
    vmask clear = v_cmp_lt(b * b, narrow * c);
    if (scene_known.model.shadow_strength <= 1.0) // a cone of slope 1 meets all
        clear = v_and(clear, v_cmp_gt(narrow, v_splat(0.0f)));
    return v_andnot(clear, rays->active);
}

// Lowers `best` by solid i for rays that do not start on it. The steps of two searches wait for each other's results, not
// for their own.
INLINE void darken_from_other(int i, const struct light_rays rays[ROWS], vfloat best[ROWS]) {
    const struct primitive *s = SHAPE(i);
    struct cone_rays r[ROWS];
    vmask met[ROWS];
    struct vec to[ROWS], zero = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    EACH_ROW(k) {
        to[k] = to_centre(s, rays[k].p);
        met[k] = cone_meets(s, to[k], &rays[k], best[k]);
    }
    if (!any_of(met))
        return;
    EACH_ROW(k)
    r[k] = (struct cone_rays){turned(s, vec_along(zero, to[k], v_splat(-1.0f))),
                              turned(s, rays[k].l), near_of_rays(), rays[k].far};
    if (s->type == SHAPE_SPHERE) {
        EACH_ROW(k) best[k] = widest_sphere(&r[k], s, best[k], met[k]);
        return;
    }
    vfloat room = room_of_scene();
    struct cone_search w[ROWS];
    vmask active[ROWS];
    EACH_ROW(k) begin_cone_search(&r[k], s, best[k], met[k], &w[k]);
    for (int step = 0; step < MOST_CONE_STEPS; step++) {
        EACH_ROW(k) {
            look_for_cone(&r[k], s, room, &w[k]);
            active[k] = w[k].active;
        }
        if (!any_of(active))
            break;
        EACH_ROW(k) step_cone_search(s, step, &w[k]);
    }
    EACH_ROW(k)
    best[k] = s->convex ? w[k].best
                        : widest_past_hull(&r[k], s, best[k], w[k].best, w[k].where, met[k], room);
}

#define DARKEN(i)                                                                                  \
    NOINLINE void darken_##i(const struct light_rays rays[ROWS], vfloat best[ROWS]) {              \
        darken_from_other(i, rays, best);                                                          \
    }
EACH_SOLID(DARKEN)
#undef DARKEN

// Lowers `best` by the solids in `bits`. Spheres first: they cost least.
INLINE void darken_by_others(uint64_t bits, struct light_rays rays[ROWS], vfloat best[ROWS]) {
    EACH_ROW(k) rays[k].active = v_cmp_gt_in(rays[k].active, rays[k].far, near_of_rays());
#define DARKEN(i)                                                                                  \
    if (SHAPE(i)->type == SHAPE_SPHERE && bits >> (i) & 1)                                         \
        darken_##i(rays, best);
    EACH_SOLID(DARKEN)
#undef DARKEN
#define DARKEN(i)                                                                                  \
    if (SHAPE(i)->type != SHAPE_SPHERE && bits >> (i) & 1)                                         \
        darken_##i(rays, best);
    EACH_SOLID(DARKEN)
#undef DARKEN
}

// A plane's ratio is least at the light: its height over the plane by the length of the ray.
INLINE vfloat darken_by_planes(const struct fused *f, vfloat per_far, vfloat best) {
    if (!f->any_low)
        return best;
#define DARKEN(i)                                                                                  \
    if (f->low[i])                                                                                 \
        best = v_min(best, v_max(v_splat(f->light_height[i]) * per_far, v_splat(0.0f)));
    EACH_PLANE(DARKEN)
#undef DARKEN
    return best;
}

INLINE vfloat lit_best(void) {
    return v_splat((float)(1.0 / scene_known.model.shadow_strength));
}

INLINE vfloat light_share(vfloat best) {
    return v_min(v_splat((float)scene_known.model.shadow_strength) * best, v_splat(1.0f));
}

// Returns how much of a colour comes through the fog from p, which is no further than `far` from the origin. If little
// fog is before that, the exponential has the same bits without being reduced.
INLINE vfloat through_fog(struct vec p, double far) {
    if (!scene_known.model.features.fog)
        return v_splat(1.0f);
    vfloat square = v_max(vec_dot(p, p), v_splat(1e-30f)), root = square * v_rsqrt_newton(square);
    vfloat power = v_splat((float)-scene_known.model.fog) * square * root;
    return scene_known.model.fog * far * far * far < 0.34 ? v_exp_near_0(power) : v_exp(power);
}

// Returns a bound of the distance of points of shape i from the origin.
INLINE double farthest_of(int i) {
    const struct primitive *s = SHAPE(i);
    double square =
        s->centre[0] * s->centre[0] + s->centre[1] * s->centre[1] + s->centre[2] * s->centre[2];
    return s->eval == EVAL_LINEAR ? INFINITY : sqrt(square) + s->bound;
}

INLINE vfloat highlight(const struct primitive *s, vfloat shine) {
    vfloat least = v_splat(1e-30f), power = phong_power(v_max(shine, least), v_splat(s->shininess));
    if (s->shininess < 1.0f) // a low power of `least` is seen
        power = v_select_or_zero(v_cmp_gt(shine, least), power);
    return v_splat(0.2f) * power;
}

// Hits of a packet on one shape. n: towards the rays' origins.
struct seen {
    vmask m;
    struct vec local, p, n, d;
    vfloat weight;
};

// Member by member, as all structs with a mask are set here: copying one whose mask was just written stalls.
INLINE void set_seen(struct seen *at, vmask m, struct vec local, struct vec p, struct vec n,
                     struct vec d, vfloat weight) {
    at->m = m;
    at->local = local;
    at->p = p;
    at->n = n;
    at->d = d;
    at->weight = weight;
}

// Light towards a packet's hits.
struct arriving {
    struct vec l; // not of unit length
    vfloat per, far, facing;
    vmask front;
};

// Lowers `best` by the solid i on which the rays start.
INLINE void darken_by_self(int i, const struct seen at[ROWS], const struct light_rays rays[ROWS],
                           const vmask grazes[ROWS], const vmask far_side[ROWS],
                           vfloat best[ROWS]) {
    const struct primitive *s = SHAPE(i);
    vfloat near = near_of_rays();
    EACH_ROW(k) {
        struct vec l = turned(s, rays[k].l);
        vmask m = v_cmp_gt_in(grazes[k], rays[k].far, near);
        best[k] = v_select(m, v_min(best[k], own_ratio(s, at[k].local, l, near)), best[k]);
        if (!s->convex && v_any(far_side[k])) {
            struct cone_rays r = {at[k].local, l, v_max(near, v_splat(NEAR_TUBE * s->b)),
                                  rays[k].far};
            best[k] = widest_torus(&r, s, best[k], v_cmp_lt_in(far_side[k], r.near, r.far),
                                   room_of_scene());
        }
    }
}

// Returns the shares of light that shape i itself and the solids in `bits` leave.
INLINE void find_shares(int i, const struct seen at[ROWS], const struct arriving to[ROWS],
                        uint64_t bits, const struct fused *f, vfloat share[ROWS]) {
    const struct primitive *s = SHAPE(i);
    struct light_rays rays[ROWS];
    vmask grazes[ROWS], far_side[ROWS];
    vfloat best[ROWS];
    EACH_ROW(k) {
        best[k] = darken_by_planes(f, to[k].per, lit_best());
        set_light_rays(&rays[k], at[k].p, to[k].l, to[k].per, to[k].far, to[k].front);
        grazes[k] = far_side[k] = v_mask_none();
        if (s->eval == EVAL_LINEAR)
            continue;
        grazes[k] = v_cmp_lt_in(to[k].front, to[k].facing, v_splat(scene_known.lit_slope));
        struct vec q = at[k].local;
        if (!s->convex)
            far_side[k] =
                v_cmp_lt_in(to[k].front, v_madd(q.x, q.x, q.z * q.z), v_splat(s->a * s->a));
    }
    if (s->eval != EVAL_LINEAR && (any_of(grazes) || (!s->convex && any_of(far_side))))
        darken_by_self(i, at, rays, grazes, far_side, best);
    if (bits)
        darken_by_others(bits, rays, best);
    EACH_ROW(k) share[k] = light_share(best[k]);
}

INLINE void add_where(vmask m, struct vec *to, struct vec a) {
    to->x = v_add_where(m, to->x, a.x);
    to->y = v_add_where(m, to->y, a.y);
    to->z = v_add_where(m, to->z, a.z);
}

// Adds the colour of shape i, `base`, to the lanes of at[].m. Sets their weight behind the fog.
// i −1: of several shapes that one_light() holds for.
INLINE void shade_seen(int i, const struct vec base[ROWS], const struct seen at[ROWS],
                       uint64_t bits, const struct fused *f, struct vec color[ROWS],
                       vfloat weight[ROWS]) {
    const struct primitive *s = SHAPE(i < 0 ? 0 : i);
    const bool flat = i >= 0 && s->eval == EVAL_LINEAR;
    struct arriving to[ROWS];
    vfloat reach[ROWS], specular[ROWS], share[ROWS];
    vmask front[ROWS];
    EACH_ROW(k) {
        weight[k] = through_fog(at[k].p, i < 0 ? INFINITY : farthest_of(i)) * at[k].weight;
        struct vec l = vec_sub(vec_set(f->light), at[k].p);
        vfloat along = flat ? add_dot(s->normal, l) : vec_dot(at[k].n, l);
        vfloat down = flat ? add_dot(s->normal, at[k].d) : vec_dot(at[k].n, at[k].d);
        vfloat square = vec_dot(l, l), per = v_rsqrt_newton(square);
        front[k] = v_cmp_gt_in(at[k].m, along, v_splat(0.0f));
        to[k].l = l;
        to[k].per = per;
        to[k].far = square * per;
        to[k].facing = along * per;
        to[k].front = front[k];
        vfloat shine = v_nmadd(along + along, down, vec_dot(l, at[k].d)) * per;
        specular[k] = highlight(s, shine);
        reach[k] = v_select_or_zero(front[k], weight[k] * per);
        share[k] = v_splat(1.0f);
    }
    if (scene_known.model.shadows != SHADOWS_NONE && any_of(front))
        find_shares(i, at, to, bits, f, share);
    const float *e = f->emission;
    EACH_ROW(k) {
        struct vec sum = vec_scale(base[k], weight[k] * v_splat(0.01f)), b = base[k];
        reach[k] = reach[k] * share[k];
        sum.x = v_madd(v_madd(b.x, to[k].facing, specular[k]) * reach[k], v_splat(e[0]), sum.x);
        sum.y = v_madd(v_madd(b.y, to[k].facing, specular[k]) * reach[k], v_splat(e[1]), sum.y);
        sum.z = v_madd(v_madd(b.z, to[k].facing, specular[k]) * reach[k], v_splat(e[2]), sum.z);
        add_where(at[k].m, &color[k], sum);
    }
}

INLINE void shade_shape(int i, const struct seen at[ROWS], uint64_t bits, const struct fused *f,
                        struct vec color[ROWS], vfloat weight[ROWS]) {
    struct vec base[ROWS];
    EACH_ROW(k) base[k] = vec_set(SHAPE(i)->color);
    shade_seen(i, base, at, bits, f, color, weight);
}

// Whether hits on shapes differ by normal and colour alone.
INLINE bool one_light(void) {
    return WHOLE_SHININESS && scene_known.model.shadows == SHADOWS_NONE &&
           !scene_known.model.features.mirrors;
}

#define SHADE(i)                                                                                   \
    NOINLINE void shade_##i(const struct seen at[ROWS], uint64_t bits, const struct fused *f,      \
                            struct vec color[ROWS], vfloat weight[ROWS]) {                         \
        shade_shape(i, at, bits, f, color, weight);                                                \
    }
EACH_PLANE(SHADE)
EACH_SOLID(SHADE)
#undef SHADE

// The normals of solid i towards the rays' origins.
INLINE struct vec normal_towards(int i, struct vec local, struct vec d) {
    const struct primitive *s = SHAPE(i);
    struct vec n = turned_back(s, normal_on(local, s));
    vmask away = v_cmp_gt(vec_dot(n, d), v_splat(0.0f));
    return (struct vec){v_negate_where(away, n.x), v_negate_where(away, n.y),
                        v_negate_where(away, n.z)};
}
