// Mirror rays: they stay in the lanes of the packet that they leave, whatever the other lanes do.
#pragma once

#include "fused/light.h"
#include "hit/scene_bounds.h"

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

// Intersects mirror rays with solid i: hit_from_surface() of frame/analytic_tile.c, where the start is known to be
// outside of it unless crevice[i].
INLINE void mirror_to_solid(int i, const struct mirror_rays *rays, const struct fused *f,
                            struct surface_hit *hit) {
    const struct primitive *s = SHAPE(i);
    vmask active = rays->active, self = is_shape(rays->leaves, i), behind, met;
    vfloat t;
    struct vec local, o = to_local(s, rays->origin), d = turned(s, rays->direction);
    if (f->crevice[i]) {
        met = hit_from_surface(o, d, s, active, self, &t, &local);
    } else {
        if (s->convex)
            active = v_andnot(self, active);
        met = enter(o, d, s, active, &t, &local, &behind);
    }
    take_hit(v_and(met, v_cmp_lt(t, hit->t)), t, local, s, hit);
}

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

// Sets the mirror rays of the lanes that see shape i.
INLINE void reflect(int i, const struct seen *at, vfloat weight, struct mirror_rays *next) {
    const struct primitive *s = SHAPE(i);
    if (!(s->share > 0.0f) || scene_known.model.march.max_bounces <= 0)
        return;
    struct vec n = s->eval == EVAL_LINEAR ? vec_set(s->normal) : at->n;
    vfloat offset = v_splat((float)scene_known.model.march.surface_offset);
    next->origin = vec_select(at->m, vec_along(at->p, n, offset), next->origin);
    next->direction = vec_select(at->m, vec_reflect(at->d, n), next->direction);
    next->weight = v_select(at->m, weight * v_splat(s->share), next->weight);
    next->leaves = v_select(at->m, v_splat(s->index), next->leaves);
    next->active = v_or(next->active, at->m);
}

// Where packets end, before they are shaded.
struct ends {
    struct surface_hit hit;
    struct vec p, d;
    vfloat weight;
};

// Adds the colour of packets' hits on the shapes `hits`, and sets the mirror rays that leave them. every: the solids
// that darken a plane are looked for among the frame's regions; else they are `darkeners`.
INLINE void shade_hits(const struct ends end[ROWS], uint64_t hits, bool every, uint64_t darkeners,
                       const struct fused *f, struct vec color[ROWS],
                       struct mirror_rays next[ROWS]) {
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
        EACH_ROW(k) mirror_to_solid(i, &rays[k], f, &end[k].hit);
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
