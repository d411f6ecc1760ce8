// Where along a ray the ratio of a sharp group may be below the best one: PROOFS.md, 10.
#pragma once

#include "hit/sharp.h"
#include "shadow/soft_packet.h"
#include "types/sdf.h"

struct part_span {
    vfloat in, out;
    vmask met;
};

// Clips the span to where a cone of slope `best` < 1 about the ray meets the leaf's sphere. A convex leaf's distance that
// begins above best·t and rises faster stays there.
static void clip_to_leaf(const struct primitive *s, struct vec o, struct vec d, vfloat near,
                         vfloat best, struct part_span *span) {
    vfloat zero = v_splat(0.0f), radius = v_splat(s->bound), begin = v_splat(0.01f);
    struct vec v = vec_sub(vec_set(s->position), o);
    vfloat along = vec_dot(v, d), a = v_nmadd(best, best, v_splat(1.0f));
    struct vec aside = vec_along(v, d, zero - along);
    vfloat rest = v_madd(best, along, radius), b = v_madd(best, radius, along);
    vfloat inside = v_msub(rest, rest, a * vec_dot(aside, aside));
    vfloat root = v_sqrt(v_max(inside, zero)), per = v_splat(1.0f) / a;
    span->in = v_max(span->in, (b - root) * per);
    span->out = v_min(span->out, (b + root) * per);
    span->met = v_and(span->met, v_and(v_cmp_gt(inside, zero), v_cmp_lt(span->in, span->out)));
    if ((int)s->type >= SHAPE_TYPES || !v_any(span->met))
        return;
    struct vec from = turned(s, vec_along(vec_scale(v, v_splat(-1.0f)), d, near));
    vfloat first = distance_at(from, s, v_mask_none());
    vfloat second = distance_at(vec_along(from, turned(s, d), begin), s, v_mask_none());
    vmask away = v_and(v_cmp_ge(first, best * near), v_cmp_ge(second - first, best * begin));
    span->met = v_andnot(away, span->met);
}

// Clips w->near and w->far to where the ratio may be below w->best, and w->active.
static void clip_to_parts(const struct sharp *sharp, struct vec o, struct vec d,
                          struct soft_packet *w) {
    vfloat begin = v_splat(INFINITY), end = v_splat(-INFINITY);
    if (v_any(v_and(w->active, v_cmp_gt(w->best, v_splat(0.99f)))))
        return;
    for (int part = 0; part < sharp->leaves; part++) {
        if (sharp->guard[part] >= 0 || sharp->removes[part])
            continue;
        struct part_span span = {w->near, w->far, w->active};
        for (int i = part; i < sharp->leaves && v_any(span.met); i++) {
            if (sharp->leaf[i].type == SHAPE_PLANE ||
                (i != part && (sharp->guard[i] != part || !sharp->holds[i])))
                continue;
            clip_to_leaf(&sharp->leaf[i], o, d, w->near, w->best, &span);
        }
        begin = v_select(span.met, v_min(begin, span.in), begin);
        end = v_select(span.met, v_max(end, span.out), end);
    }
    w->near = v_max(w->near, begin);
    w->far = v_min(w->far, end);
    w->active = v_and(w->active, v_cmp_lt(w->near, w->far));
}
