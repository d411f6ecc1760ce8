// Where along a ray the ratio of a sharp group may be below the best one: PROOFS.md, 10.
#pragma once

#include "fields/rays.h"
#include "hit/sharp.h"
#include "shadow/soft_packet.h"
#include "shadow/widest_cone.h"
#include "types/sdf.h"

// Clips the span to where a cone of slope `best` < 1 about the ray meets the leaf's sphere.
static void clip_to_leaf(const struct primitive *s, struct vec o, struct vec d, vfloat best,
                         struct cone_span *span) {
    struct vec v = vec_sub(vec_set(s->position), o);
    struct cone_span met = cone_span(v, v_splat(s->bound), d, best);
    span->in = v_max(span->in, met.in);
    span->out = v_min(span->out, met.out);
    span->met = v_and(span->met, v_and(met.met, v_cmp_lt(span->in, span->out)));
}

// The convex leaves that hold a part of a sharp group. Their greatest distance is convex along a ray.
struct part_leaves {
    const struct primitive *leaf[SHARP_LEAVES];
    struct cone_rays rays[SHARP_LEAVES]; // in the leaves' frames
    int count;
};

// An end of the bracket about the least ratio. The ratio is nowhere below slope + p/t, its tangent in 1/t. leaf: which decides
// there; −1: not seen.
struct part_end {
    vfloat t, slope, p, leaf;
};

static inline struct part_end later_end(vmask here, struct part_end now, struct part_end old) {
    return (struct part_end){v_select(here, now.t, old.t), v_select(here, now.slope, old.slope),
                             v_select(here, now.p, old.p), v_select(here, now.leaf, old.leaf)};
}

static struct along_ray along_leaf(const struct cone_rays *r, vfloat t, const struct primitive *s) {
    struct vec p = vec_along(r->o, r->d, t);
    vfloat one = v_splat(1.0f), beyond;
    switch ((int)s->type) {
    case SHAPE_SPHERE: return along_root(vec_dot(p, p), vec_dot(p, r->d), one, s->a);
    case SHAPE_CAPSULE:
        beyond = p.y - v_min(v_max(p.y, v_splat(-s->c)), v_splat(s->c));
        one = v_select(v_cmp_lt(v_abs(beyond), v_splat(1e-30f)), v_nmadd(r->d.y, r->d.y, one), one);
        p.y = beyond;
        return along_root(vec_dot(p, p), vec_dot(p, r->d), one, s->a);
    default: return along_solid(r, t, s);
    }
}

// Looks at the part at t: returns the end that this makes, and sets the distance and Newton's next t (step_cone_search()).
static struct part_end look_at_part(const struct part_leaves *part, vfloat t, vfloat *h,
                                    vfloat *next) {
    struct along_ray at = along_leaf(&part->rays[0], t, part->leaf[0]);
    vfloat leaf = v_splat(0.0f), core = leaf;
    for (int i = 0; i < part->count; i++) {
        struct along_ray other = i > 0 ? along_leaf(&part->rays[i], t, part->leaf[i]) : at;
        bool round =
            part->leaf[i]->type == SHAPE_SPHERE || (int)part->leaf[i]->type == SHAPE_CAPSULE;
        vmask more = v_cmp_ge(other.h, at.h);
        at.h = v_select(more, other.h, at.h);
        at.slope = v_select(more, other.slope, at.slope);
        at.bend = v_select(more, other.bend, at.bend);
        leaf = v_select(more, v_splat((float)i), leaf);
        core = v_select(more, v_splat(round ? part->leaf[i]->a : core_radius(part->leaf[i])), core);
    }
    vfloat p = v_nmadd(t, at.slope, at.h), e = v_madd(p + core, p, t * t * at.bend);
    vfloat rest = v_nmadd(at.h + core, p, e);
    vmask inside = v_and(v_cmp_gt(rest, v_splat(0.0f)), v_cmp_gt(e, v_splat(0.0f)));
    *next = v_select_or_zero(inside, t * e * quick_inverse(rest));
    *h = at.h;
    return (struct part_end){t, at.slope, p, leaf};
}

// Returns a lower bound of the part's ratio, less than `room` below its least, or one that is no less than `best`.
// *where: t of the least. Steps are Newton's; between ends where different leaves decide, to where both tangents meet.
static vfloat least_of_part(const struct part_leaves *part, const struct cone_span *span,
                            vfloat best, float room, vfloat *where) {
    vfloat zero = v_splat(0.0f), none = v_splat(-1.0f), least = v_splat(INFINITY), below = zero;
    struct part_end low = {span->in, zero, zero, none}, high = {span->out, zero, zero, none};
    vmask active = span->met;
    vfloat t = zero - vec_dot(part->rays[0].o, part->rays[0].d), h, next;
    t = *where = v_min(v_max(t, low.t), high.t);
    for (int step = 0; step < MOST_CONE_STEPS; step++) {
        ACTIVE(v_count(active));
        COUNT(widest_step, call);
        struct part_end now = look_at_part(part, t, &h, &next);
        vfloat ratio = h * quick_inverse(t);
        vmask less = v_and(active, v_cmp_lt(ratio, least)), later = v_cmp_gt(now.p, zero);
        least = v_select(less, ratio, least);
        *where = v_select(less, t, *where);
        vfloat end = v_select(later, high.t, low.t);
        low = later_end(later, now, low);
        high = later_end(v_not(later), now, high);
        vfloat bound = v_nmadd(v_abs(now.p), v_abs(end - t) / (end * t), ratio);
        vmask both = v_cmp_ge(v_min(low.leaf, high.leaf), zero);
        vfloat meet = (high.slope - low.slope) / v_max(low.p - high.p, v_splat(1e-20f)); // 1/t
        bound = v_select(both, v_max(v_madd(low.p, meet, low.slope), bound), bound);
        below = v_select(active, bound, below);
        vmask close = v_cmp_ge(bound, v_min(least - v_splat(room), best));
        active = v_andnot(v_or(close, v_cmp_le(least, zero)), active);
        if (!v_any(active))
            break;
        vmask kink = v_cmp_gt(v_abs(low.leaf - high.leaf), v_splat(step % 3 == 2 ? -1.0f : 0.0f));
        vmask newton = v_and(v_cmp_gt(next, low.t), v_cmp_lt(next, high.t));
        t = v_select(newton, next, v_select(later, high.t, low.t));
        t = v_select(v_and(both, v_or(kink, v_not(newton))), v_splat(1.0f) / meet, t);
        t = v_min(v_max(t, low.t), high.t);
    }
    return below;
}

#define PART_ROOM 0x1p-14f

static inline struct cone_rays rays_of_leaf(const struct primitive *s, struct vec o, struct vec d) {
    struct vec from = turned(s, vec_sub(o, vec_set(s->position)));
    return (struct cone_rays){.o = from, .d = turned(s, d)};
}

// Raises the lower bound `least` of rays that begin in a hole: in the part, and in leaf s that is cut from it. There −h/t of
// the leaf falls and the part's ratio rises. They meet where the sum of both distances is 0. It is convex: Newton's steps from
// beyond come no nearer than that.
static void rise_from_cut(const struct part_leaves *part, const struct primitive *s,
                          const struct cone_rays *r, const struct cone_span *span, vmask begins,
                          vfloat *least, vfloat *where) {
    vfloat zero = v_splat(0.0f), t = span->out, h, next;
    look_at_part(part, span->in, &h, &next);
    begins = v_and(begins, v_cmp_le(v_max(along_leaf(r, span->in, s).h, h), zero));
    vmask active = begins;
    for (int step = 0; step < MOST_CONE_STEPS && v_any(active); step++) {
        COUNT(widest_step, call);
        struct part_end now = look_at_part(part, t, &h, &next);
        struct along_ray cut = along_leaf(r, t, s);
        vfloat low = (zero - cut.h) / t, sum = h + cut.h;
        vmask more = v_and(active, v_cmp_gt(low, *least));
        *least = v_select(more, low, *least);
        *where = v_select(more, t, *where);
        active = v_and(active, v_cmp_gt(v_abs(sum), v_splat(PART_ROOM) * t));
        t = v_max(t - sum / v_max(now.slope + cut.slope, v_splat(1e-3f)), span->in);
    }
}

// Lowers w->best by a part of a sharp group. cut: bits of its leaves that are cut from it. Returns the rays on which the rest
// of the group's field, which cuts the convex leaves, decides where they come nearest.
static vmask widest_of_part(const struct primitive *s, unsigned cut, const struct part_leaves *part,
                            struct vec o, struct vec d, const struct cone_span *span,
                            struct soft_packet *w) {
    vfloat zero = v_splat(0.0f), where;
    vfloat least = least_of_part(part, span, w->best, PART_ROOM, &where);
    vmask inside = v_and(span->met, v_cmp_le(least, zero));
    for (unsigned rest = cut; rest && v_any(inside); rest &= rest - 1) {
        const struct primitive *leaf = &SHARP_OF(s)->leaf[__builtin_ctz(rest)];
        if (leaf->type == SHAPE_PLANE)
            continue;
        struct cone_rays rays = rays_of_leaf(leaf, o, d);
        rise_from_cut(part, leaf, &rays, span, inside, &least, &where);
    }
    vmask met = v_and(span->met, v_cmp_lt(least, w->best));
    if (!v_any(met))
        return met;
    vfloat ratio = field_distance(FIELD_OF(s), vec_along(o, d, where)) / where;
    w->best = v_select(met, v_min(w->best, v_max(ratio, zero)), w->best);
    return v_and(met, v_cmp_lt(least + v_splat(2 * PART_ROOM), w->best));
}

// Lowers w->best by the parts, and clips w->near, w->far and w->active to where the ratio may still be below it.
static void clip_to_parts(const struct primitive *s, struct vec o, struct vec d,
                          struct soft_packet *w) {
    const struct sharp *sharp = SHARP_OF(s);
    vfloat begin = v_splat(INFINITY), end = v_splat(-INFINITY);
    if (v_any(v_and(w->active, v_cmp_gt(w->best, v_splat(0.99f)))))
        return;
    for (int part = 0; part < sharp->parts; part++) {
        struct cone_span span = {w->active, w->near, w->far};
        struct part_leaves leaves;
        leaves.count = 0;
        for (unsigned rest = sharp->part[part].kept; rest && v_any(span.met); rest &= rest - 1) {
            const struct primitive *leaf = &sharp->leaf[__builtin_ctz(rest)];
            if (leaf->type == SHAPE_PLANE)
                continue;
            clip_to_leaf(leaf, o, d, w->best, &span);
            leaves.leaf[leaves.count] = leaf;
            leaves.rays[leaves.count++] = rays_of_leaf(leaf, o, d);
        }
        if (leaves.count > 0 && v_any(span.met)) // half-spaces alone may hold any part
            span.met = widest_of_part(s, sharp->part[part].cut, &leaves, o, d, &span, w);
        begin = v_select(span.met, v_min(begin, span.in), begin);
        end = v_select(span.met, v_max(end, span.out), end);
    }
    w->near = v_max(w->near, begin);
    w->far = v_min(w->far, end);
    w->active = v_and(w->active, v_cmp_lt(w->near, w->far));
}
