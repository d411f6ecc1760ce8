// Mirror rays: they stay in the lanes of the packet that they leave, whatever the other lanes do.
#pragma once

struct mirror_rays {
    struct vec origin, direction;
    vfloat weight, leaves; // leaves: the shape on which the ray starts
    vmask active;
};

INLINE void no_mirror_rays(struct mirror_rays *rays) {
    vfloat zero = v_splat(0.0f);
    rays->origin = rays->direction = (struct vec){zero, zero, zero};
    rays->weight = rays->leaves = zero;
    rays->active = v_mask_none();
}

// Where packets end, before they are shaded.
struct ends {
    struct surface_hit hit;
    struct vec p, d;
    vfloat weight;
};

// Where mirror rays enter solid i, o and d in its frame.
#define ENTER(i)                                                                                   \
    INLINE void enter_from_mirror_##i(const struct vec o[ROWS], const struct vec d[ROWS],          \
                                      const vmask active[ROWS], struct torus_hit hit[ROWS],        \
                                      vmask behind[ROWS]) {                                        \
        if (SHAPE(i)->type == SHAPE_TORUS)                                                         \
            enter_tori_##i(o, d, active, hit);                                                     \
        else                                                                                       \
            EACH_ROW(k)                                                                            \
        hit[k].met = enter(o[k], d[k], SHAPE(i), active[k], &hit[k].t, &hit[k].local, &behind[k]); \
    }
EACH_SOLID(ENTER)
#undef ENTER

// A mirror ray that starts surface_offset off its surface, in a crevice inside of solid i, hits that at once: see
// hit_from_surface() of frame/analytic_tile.c.
INLINE void hit_from_inside(int i, struct vec o, struct vec d, vmask within,
                            struct torus_hit *hit) {
    const struct primitive *s = SHAPE(i);
    if (!v_any(within))
        return;
    vfloat h = distance_at(o, s, v_mask_none());
    vmask inside = v_cmp_gt_in(within, v_splat(0.0f), h);
    hit->t = v_select(inside, h, hit->t);
    hit->local = vec_select(inside, vec_along(o, d, h), hit->local);
    hit->met = v_or(hit->met, inside);
}

// Returns the rays that may come into the bounding sphere of s: it holds all of it.
INLINE vmask may_come_near(const struct primitive *s, const struct mirror_rays *rays) {
    struct vec to = to_centre(s, rays->origin);
    vfloat along = v_max(vec_dot(to, rays->direction), v_splat(0.0f)), square = vec_dot(to, to);
    square = square * v_splat(1 - 0x1p-18f); // for rounding
    return v_cmp_lt_in(rays->active, square, v_madd(along, along, v_splat(s->bound_sq)));
}

// Intersects mirror rays with solid i. Where no crevice is they start outside of it.
#define MIRROR(i)                                                                                  \
    INLINE void mirror_to_solid_##i(const struct mirror_rays rays[ROWS], const struct fused *f,    \
                                    struct ends end[ROWS]) {                                       \
        const struct primitive *s = SHAPE(i);                                                      \
        struct vec o[ROWS], d[ROWS];                                                               \
        vmask active[ROWS], others[ROWS], behind[ROWS];                                            \
        struct torus_hit hit[ROWS];                                                                \
        EACH_ROW(k) active[k] = may_come_near(s, &rays[k]);                                        \
        if (!any_of(active))                                                                       \
            return;                                                                                \
        EACH_ROW(k) {                                                                              \
            o[k] = to_local(s, rays[k].origin);                                                    \
            d[k] = turned(s, rays[k].direction);                                                   \
            others[k] = v_andnot(is_shape(rays[k].leaves, i), rays[k].active);                     \
            active[k] = s->convex ? others[k] : rays[k].active;                                    \
            behind[k] = v_cmp_lt_in(others[k], vec_dot(o[k], o[k]), v_splat(s->bound_sq));         \
        }                                                                                          \
        enter_from_mirror_##i(o, d, active, hit, behind);                                          \
        EACH_ROW(k) {                                                                              \
            if (f->crevice[i])                                                                     \
                hit_from_inside(i, o[k], d[k], behind[k], &hit[k]);                                \
            take_hit(v_and(hit[k].met, v_cmp_lt(hit[k].t, end[k].hit.t)), hit[k].t, hit[k].local,  \
                     s, &end[k].hit);                                                              \
        }                                                                                          \
    }
EACH_SOLID(MIRROR)
#undef MIRROR

INLINE void mirror_to_plane(int i, const struct mirror_rays *rays, struct surface_hit *hit) {
    const struct primitive *s = SHAPE(i);
    vfloat slope = add_dot(s->normal, rays->direction), height = height_over(s, rays->origin);
    vmask under = v_cmp_lt(height, v_splat(0.0f)), self = is_shape(rays->leaves, i);
    vfloat t = v_select(under, height, height * quick_inverse(v_splat(0.0f) - slope));
    vmask met = v_and(v_andnot(self, rays->active), v_or(under, v_cmp_lt(slope, v_splat(0.0f))));
    take_hit(v_and(met, v_cmp_lt(t, hit->t)), t, hit->local, s, hit);
}

// Returns the solids that may darken points of plane i.
INLINE uint64_t darkeners_at(int i, const struct vec p[ROWS], const vmask on[ROWS],
                             const struct fused_frame *frame) {
    uint64_t bits = 0;
    for (int n = 0; n < frame->dark_count; n++) {
        const struct dark_region *dark = &frame->dark[n];
        if (dark->plane != i)
            continue;
        vmask near[ROWS];
        EACH_ROW(k) {
            struct vec to = vec_sub(p[k], vec_set(dark->centre));
            near[k] = v_cmp_lt_in(on[k], vec_dot(to, to), v_splat(dark->radius_sq));
        }
        bits |= any_of(near) ? bit_of(dark->solid) : 0;
    }
    return bits;
}

// Removes hits beyond the bounds. Only planes reach there.
INLINE void keep_in_bounds(struct vec o, struct vec d, struct vec p, struct surface_hit *hit) {
    double radius = scene_known.model.march.bounds_radius;
    float bound = (float)(radius * radius);
    vfloat square = vec_dot(p, p);
    vmask doubtful = v_cmp_gt_in(hit->found, square, v_splat(bound * (1 - 0x1p-16f)));
    if (!v_any(doubtful))
        return;
    vmask near = v_cmp_lt_in(doubtful, square, v_splat(bound * (1 + 0x1p-16f))),
          in = v_cmp_ge(v_splat(bound), square);
    if (v_any(near)) {
        const vfloat parts[8] = {o.x, o.y, o.z, d.x, d.y, d.z, hit->t, hit->shape};
        in = v_or(v_andnot(near, in), in_bounds_nearly(parts, near, &scene_known));
    }
    hit->found = v_and(hit->found, in);
}

// Sets the mirror rays of all lanes, as if each saw shape i.
INLINE void reflect_all(int i, const struct seen *at, vfloat weight, struct mirror_rays *next) {
    const struct primitive *s = SHAPE(i);
    struct vec n = s->eval == EVAL_LINEAR ? vec_set(s->normal) : at->n;
    vfloat offset = v_splat((float)scene_known.model.march.surface_offset);
    next->origin = vec_along(at->p, n, offset);
    next->direction = vec_reflect(at->d, n);
    next->weight = weight * v_splat(s->share);
    next->leaves = v_splat(s->index);
    next->active = at->m;
}

// Sets the mirror rays of the lanes that see shape i.
INLINE void reflect(int i, const struct seen *at, vfloat weight, struct mirror_rays *next) {
    struct mirror_rays all;
    if (!(SHAPE(i)->share > 0.0f) || scene_known.model.march.max_bounces <= 0)
        return;
    reflect_all(i, at, weight, &all);
    next->origin = vec_select(at->m, all.origin, next->origin);
    next->direction = vec_select(at->m, all.direction, next->direction);
    next->weight = v_select(at->m, all.weight, next->weight);
    next->leaves = v_select(at->m, all.leaves, next->leaves);
    next->active = v_or(next->active, at->m);
}

INLINE struct vec normal_seen(int i, const struct ends *end) {
    return SHAPE(i)->eval == EVAL_LINEAR ? vec_set(SHAPE(i)->normal)
                                         : normal_towards(i, end->hit.local, end->d);
}

// Adds the colour of packets' hits on the shapes `hits`: normals and colours are chosen, then lit once.
INLINE void shade_at_once(const struct ends end[ROWS], uint64_t hits, const struct fused *f,
                          struct vec color[ROWS]) {
    struct seen at[ROWS];
    struct vec base[ROWS];
    vfloat weight[ROWS];
    EACH_ROW(k) {
        base[k] = vec_set(SHAPE(0)->color);
        set_seen(&at[k], end[k].hit.found, end[k].hit.local, end[k].p, vec_set(SHAPE(0)->normal),
                 end[k].d, end[k].weight);
    }
#define SEE(i)                                                                                     \
    EACH_ROW(k) if (hits >> (i) & 1) {                                                             \
        vmask m = is_shape(end[k].hit.shape, i);                                                   \
        at[k].n = vec_select(m, normal_seen(i, &end[k]), at[k].n);                                 \
        base[k] = vec_select(m, vec_set(SHAPE(i)->color), base[k]);                                \
    }
    EACH_PLANE(SEE)
    EACH_SOLID(SEE)
#undef SEE
    shade_seen(-1, base, at, 0, f, color, weight);
}

// Adds the colour of packets' hits on the shapes `hits`, and sets the mirror rays that leave them. every: the solids
// that darken a plane are looked for among the frame's regions; else they are `darkeners`.
INLINE void shade_hits(const struct ends end[ROWS], uint64_t hits, bool every, uint64_t darkeners,
                       const struct fused *f, struct vec color[ROWS],
                       struct mirror_rays next[ROWS]) {
    if (one_light()) {
        shade_at_once(end, hits, f, color);
        return;
    }
    struct seen at[ROWS];
    struct vec p[ROWS];
    vmask m[ROWS];
    vfloat weight[ROWS];
    EACH_ROW(k) p[k] = end[k].p;
#define SEE(i, normal, by)                                                                         \
    if (hits >> (i) & 1) {                                                                         \
        EACH_ROW(k) m[k] = v_and(end[k].hit.found, is_shape(end[k].hit.shape, i));                 \
        if (any_of(m)) {                                                                           \
            EACH_ROW(k)                                                                            \
            set_seen(&at[k], m[k], end[k].hit.local, end[k].p, normal, end[k].d, end[k].weight);   \
            shade_##i(at, by, f, color, weight);                                                   \
            EACH_ROW(k) reflect(i, &at[k], weight[k], &next[k]);                                   \
        }                                                                                          \
    }
#define SEE_PLANE(i) SEE(i, end[k].d, every ? darkeners_at(i, p, m, &f->frame) : darkeners)
#define SEE_SOLID(i) SEE(i, normal_towards(i, end[k].hit.local, end[k].d), f->frame.pair[i])
    EACH_PLANE(SEE_PLANE)
    EACH_SOLID(SEE_SOLID)
#undef SEE_SOLID
#undef SEE_PLANE
#undef SEE
}

// Returns whether some ray can meet a solid: not those that are past them all and lead away.
INLINE bool may_meet(const struct mirror_rays rays[ROWS], const struct fused_frame *frame, int i) {
    vmask may[ROWS];
    EACH_ROW(k) {
        may[k] = rays[k].active;
        for (int g = 0; g < SPAN_GUARDS; g++) {
            struct vec n = vec_set(frame->guard[i][g]);
            vfloat past = v_min(vec_dot(n, rays[k].origin) - v_splat(frame->guard_top[i][g]),
                                vec_dot(n, rays[k].direction));
            may[k] = v_andnot(v_cmp_ge(past, v_splat(0.0f)), may[k]);
        }
    }
    return any_of(may);
}

INLINE bool any_active(const struct mirror_rays rays[ROWS]) {
    vmask active[ROWS];
    EACH_ROW(k) active[k] = rays[k].active;
    return any_of(active);
}

// Adds the colour that the rays see, bounce after bounce. may: solids that the first can meet. guarded: the solid that
// they leave, −1: several.
NOINLINE void follow_mirror(struct mirror_rays rays[ROWS], uint64_t may, int guarded,
                            const struct fused *f, struct vec color[ROWS]) {
    for (int bounce = 1; any_active(rays); bounce++) {
        struct ends end[ROWS];
        EACH_ROW(k) {
            no_hit(&end[k].hit);
#define MEET(i) mirror_to_plane(i, &rays[k], &end[k].hit);
            EACH_PLANE(MEET)
#undef MEET
        }
        if (guarded < 0 || may_meet(rays, &f->frame, guarded)) {
#define MEET(i)                                                                                    \
    if (may >> (i) & 1)                                                                            \
        mirror_to_solid_##i(rays, f, end);
            EACH_SOLID(MEET)
#undef MEET
        }
        struct mirror_rays next[ROWS];
        vmask found[ROWS];
        EACH_ROW(k) {
            end[k].d = rays[k].direction;
            end[k].weight = rays[k].weight;
            end[k].p = vec_along(rays[k].origin, end[k].d, end[k].hit.t);
            keep_in_bounds(rays[k].origin, end[k].d, end[k].p, &end[k].hit);
            found[k] = end[k].hit.found;
            add_where(v_andnot(found[k], rays[k].active), &color[k],
                      background(rays[k].weight, &scene_known.model));
            no_mirror_rays(&next[k]);
        }
        if (any_of(found))
            shade_hits(end, ~0ull, true, 0, f, color, next);
        if (bounce >= scene_known.model.march.max_bounces)
            return;
        EACH_ROW(k) {
            rays[k].origin = next[k].origin;
            rays[k].direction = next[k].direction;
            rays[k].weight = next[k].weight;
            rays[k].leaves = next[k].leaves;
            rays[k].active = next[k].active;
        }
        may = ~0ull;
        guarded = -1;
    }
}
