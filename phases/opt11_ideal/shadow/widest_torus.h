// The widest cone about a ray that holds nothing of a torus. Outside of the cylinder about its ring the distance
// is its hull's, which is convex. Inside, the distance from the axis is a convex function of the ray, and a chord
// above it bounds the ratio from below in closed form: branch and bound (PROOFS.md, 4.).
#pragma once

#include "shadow/widest_cone.h"

// A part of a ray inside the cylinder, by u = 1/t.
struct ring_part {
    vfloat from, to;
    vmask active;
};

enum { RING_STACK = 32, MOST_RING_PARTS = 256 };

// The distance from the axis times u.
INLINE vfloat ring_radius(const struct cone_rays *r, vfloat u) {
    vfloat x = v_madd(u, r->o.x, r->d.x), z = v_madd(u, r->o.z, r->d.z);
    return v_sqrt(v_madd(x, x, z * z));
}

// Returns a lower bound of the ratio in a part, and the u at which it lies. In the plane of the two distances to
// the ring, inward and up, both bounds are linear: |P + w·Q| − (from + w)·tube, whose minimum is closed.
INLINE vfloat ring_bound(const struct cone_rays *r, const struct ring_part *part,
                         const struct primitive *s, vfloat *u) {
    vfloat zero = v_splat(0.0f), tube = v_splat(s->b), tiny = v_splat(1e-30f);
    vfloat width = part->to - part->from, first = ring_radius(r, part->from);
    vfloat steep = (ring_radius(r, part->to) - first) / v_max(width, tiny);
    vfloat px = v_msub(part->from, v_splat(s->a), first), qx = v_splat(s->a) - steep;
    vfloat py = v_madd(part->from, r->o.y, r->d.y), qy = r->o.y;
    vfloat size = v_madd(qx, qx, qy * qy), excess = v_nmadd(tube, tube, size);
    vfloat apart = v_abs(v_msub(px, qy, py * qx));
    vfloat w = v_madd(apart, tube / v_sqrt(v_max(excess, tiny)), zero - v_madd(px, qx, py * qy)) /
               v_max(size, tiny);
    w = v_select(v_cmp_gt(excess, zero), v_min(v_max(w, zero), width), width);
    vfloat x = v_madd(w, qx, px), y = v_madd(w, qy, py);
    *u = part->from + w;
    return v_nmadd(*u, tube, v_sqrt(v_madd(x, x, y * y)));
}

// Returns the lesser of `best` and the least ratio inside the cylinder, to within `room`.
static vfloat widest_in_ring(const struct cone_rays *r, vfloat from, vfloat to,
                             const struct primitive *s, vfloat best, vmask active, vfloat room) {
    struct ring_part stack[RING_STACK];
    vfloat zero = v_splat(0.0f), high = v_splat(1.0f) / from, low = v_splat(1.0f) / to;
    vfloat least = (high - low) * v_splat(2.5e-6f);
    int count = 1;
    stack[0] = (struct ring_part){low, high, active};
    for (int parts = 0; count > 0 && parts < MOST_RING_PARTS; parts++) {
        struct ring_part part = stack[--count];
        vfloat u, bound = ring_bound(r, &part, s, &u);
        part.active = v_and(part.active, v_cmp_lt(bound, best - room));
        if (!v_any(part.active))
            continue;
        vfloat inward = v_msub(u, v_splat(s->a), ring_radius(r, u)), up = v_madd(u, r->o.y, r->d.y);
        vfloat ratio = v_nmadd(u, v_splat(s->b), v_sqrt(v_madd(inward, inward, up * up)));
        best = v_select(part.active, v_min(best, v_max(ratio, zero)), best);
        vfloat width = part.to - part.from;
        part.active = v_and(v_and(part.active, v_cmp_lt(bound, best - room)),
                            v_and(v_cmp_gt(best, zero), v_cmp_gt(width, least)));
        if (!v_any(part.active) || count + 2 > RING_STACK)
            continue;
        vfloat edge = v_splat(0.1f) * width;
        vfloat cut = v_min(v_max(u, part.from + edge), part.to - edge);
        stack[count++] = (struct ring_part){part.from, cut, part.active};
        stack[count++] = (struct ring_part){cut, part.to, part.active};
    }
    return best;
}

// Returns the lesser of `best` and the least ratio of the torus. hull: the same of its hull, found at `where`. If that
// is outside of the cylinder, it is the torus's. Else the ray has a part inside, and one before and one behind.
INLINE vfloat widest_past_hull(const struct cone_rays *r, const struct primitive *s, vfloat best,
                               vfloat hull, vfloat where, vmask active, vfloat room) {
    struct vec p = vec_along(r->o, r->d, where);
    vmask inside = v_cmp_lt(v_madd(p.x, p.x, p.z * p.z), v_splat(s->a * s->a));
    inside = v_and(v_and(inside, active), v_cmp_lt(hull, best));
    best = v_select(inside, best, hull);
    if (!v_any(inside))
        return best;
    vfloat zero = v_splat(0.0f);
    vfloat a = v_max(v_madd(r->d.x, r->d.x, r->d.z * r->d.z), v_splat(1e-12f));
    vfloat b = v_madd(r->o.x, r->d.x, r->o.z * r->d.z);
    vfloat c = v_madd(r->o.x, r->o.x, v_msub(r->o.z, r->o.z, v_splat(s->a * s->a)));
    vfloat root = v_sqrt(v_max(v_msub(b, b, a * c), zero));
    vfloat in = v_min(v_max((zero - b - root) / a, r->near), r->far);
    vfloat out = v_min(v_max((root - b) / a, r->near), r->far);
    struct cone_rays before = {r->o, r->d, r->near, in}, behind = {r->o, r->d, out, r->far};
    best = widest_convex(&before, s, best, v_and(inside, v_cmp_gt(in, r->near)), room, &where);
    best = widest_convex(&behind, s, best, v_and(inside, v_cmp_lt(out, r->far)), room, &where);
    return widest_in_ring(r, in, out, s, best, v_and(inside, v_cmp_lt(in, out)), room);
}

INLINE vfloat widest_torus(const struct cone_rays *r, const struct primitive *s, vfloat best,
                           vmask active, vfloat room) {
    vfloat where, hull = widest_convex(r, s, best, active, room, &where);
    return widest_past_hull(r, s, best, hull, where, active, room);
}
