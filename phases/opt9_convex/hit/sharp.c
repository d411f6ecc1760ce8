// See hit/sharp.h.
#include "hit/sharp.h"
#include "hit/solids.h"
#include "types/sdf.h"

// The part of a ray in a convex leaf.
struct span {
    vfloat in, out;
    vmask met;
};

// Where a ray enters the capsule: at `side`, where it enters the cylinder, if that is between the ends; else in the half
// ball there.
static vmask capsule_end(struct vec c, struct vec d, vfloat side, vmask near,
                         const struct primitive *s, vfloat *t) {
    vfloat zero = v_splat(0.0f), high = v_splat(s->c), y = v_madd(side, d.y, c.y);
    vmask between = v_cmp_le(v_abs(y), high);
    *t = side;
    if (!v_any(v_andnot(between, near)))
        return near;
    c.y = c.y - v_min(v_max(y, zero - high), high);
    vfloat along = vec_dot(c, d), power = vec_dot(c, c) - v_splat(s->a * s->a);
    vfloat in_ball = v_msub(along, along, power);
    *t = v_select(between, side, zero - along - v_sqrt(v_max(in_ball, zero)));
    return v_and(near, v_or(between, v_cmp_ge(in_ball, zero)));
}

static vmask pass_capsule(struct vec c, struct vec d, struct vec back, vmask near,
                          const struct primitive *s, vfloat *in, vfloat *back_in) {
    vfloat a = v_max(v_madd(d.x, d.x, d.z * d.z), v_splat(1e-12f)), zero = v_splat(0.0f);
    vfloat b = v_madd(c.x, d.x, c.z * d.z);
    vfloat away = v_madd(c.x, c.x, v_msub(c.z, c.z, v_splat(s->a * s->a)));
    vfloat inside = v_msub(b, b, a * away), root = v_sqrt(v_max(inside, zero));
    vmask met = v_and(near, v_cmp_ge(inside, zero));
    if (!v_any(met))
        return met;
    vfloat per = v_splat(1.0f) / a;
    met = capsule_end(c, d, (zero - b - root) * per, met, s, in);
    return capsule_end(c, back, (b - root) * per, met, s, back_in);
}

// Sets where a ray enters the leaf, and minus where it leaves it: where it enters it backward. Both are counted from c.
static vmask pass_leaf(struct vec c, struct vec d, vfloat half, const struct primitive *s,
                       vmask near, vfloat *in, vfloat *back_in) {
    vfloat zero = v_splat(0.0f), out = v_splat(INFINITY);
    if (s->type == SHAPE_SPHERE) {
        *in = *back_in = zero - half;
        return near;
    }
    if (s->type == SHAPE_BOX) {
        *in = zero - out;
        struct vec per = inverses_of(d);
        slab(c.x, per.x, s->size[0], in, &out);
        slab(c.y, per.y, s->size[1], in, &out);
        slab(c.z, per.z, s->size[2], in, &out);
        *back_in = zero - out;
        return v_and(near, v_cmp_ge(out, *in));
    }
    struct vec back = {zero - d.x, zero - d.y, zero - d.z};
    if ((int)s->type == SHAPE_CAPSULE)
        return pass_capsule(c, d, back, near, s, in, back_in);
    vfloat far = v_splat(INFINITY);
    near = enter_nearby(c, d, far, far, NULL, s, near, in);
    return enter_nearby(c, back, far, far, NULL, s, near, back_in);
}

__attribute__((always_inline)) static inline struct span
span_of(const struct primitive *s, struct vec o, struct vec d, vmask active) {
    vfloat zero = v_splat(0.0f), infinite = v_splat(INFINITY);
    struct span span = {zero - infinite, infinite, active};
    if (s->type == SHAPE_PLANE) {
        vfloat slope = add_dot(s->normal, d), height = height_over(s, o);
        // A ray along the face is outside, or inside, all along.
        vfloat along = v_select(v_cmp_gt(height, zero), zero - infinite, infinite);
        vmask down = v_cmp_lt(slope, zero), up = v_cmp_gt(slope, zero);
        vfloat t = v_select(v_or(down, up), height / (zero - slope), along);
        span.in = v_select(down, t, span.in);
        span.out = v_select(down, infinite, t);
        return span;
    }
    o = vec_sub(o, vec_set(s->position));
    vfloat before = zero - vec_dot(o, d);
    struct vec c = vec_along(o, d, before);
    vfloat square = vec_dot(c, c);
    span.met = v_and(active, v_cmp_lt(square, v_splat(s->bound_sq)));
    if (!v_any(span.met))
        return span;
    vfloat half = v_sqrt(v_max(v_splat(s->bound_sq) - square, zero)), in = zero, out = zero;
    span.met = pass_leaf(turned(s, c), turned(s, d), half, s, span.met, &in, &out);
    span.in = before + in;
    span.out = before - out;
    return span;
}

// The spans of leaves along a packet of rays, as they are asked for.
struct spans {
    struct vec o, d;
    vmask active;
    unsigned known; // bits of leaves
    struct span leaf[SHARP_LEAVES];
};

__attribute__((always_inline)) static inline const struct span *
span_at(struct spans *all, const struct sharp *sharp, int i) {
    if (!(all->known >> i & 1))
        all->leaf[i] = span_of(&sharp->leaf[i], all->o, all->d, all->active);
    all->known |= 1u << i;
    return &all->leaf[i];
}

// Returns p less the nearest point of the capsule's axis, in its frame.
static inline struct vec off_axis(struct vec p, const struct primitive *s) {
    p.y = p.y - v_min(v_max(p.y, v_splat(-s->c)), v_splat(s->c));
    return p;
}

// Returns which points are in the leaf, or near it by rounding: this takes less than a span.
static inline vmask near_leaf(const struct primitive *s, struct vec p) {
    if (s->type == SHAPE_PLANE)
        return v_mask_all();
    p = vec_sub(p, vec_set(s->position));
    float radius = s->bound;
    if ((int)s->type == SHAPE_CAPSULE) {
        p = off_axis(turned(s, p), s);
        radius = s->a;
    }
    return v_cmp_le(vec_dot(p, p), v_splat(radius * radius * (1.0f + 0x1p-8f)));
}

// Returns which rays are in the part between near and far, and sets t to the first place.
static vmask enter_part(struct spans *all, const struct sharp *sharp, const struct sharp_part *part,
                        vfloat near, vfloat far, vfloat *t) {
    vmask active = all->active;
    for (unsigned rest = part->kept; rest; rest &= rest - 1) {
        const struct span *s = span_at(all, sharp, __builtin_ctz(rest));
        near = v_max(near, s->in);
        far = v_min(far, s->out);
        active = v_and(active, v_and(s->met, v_cmp_lt(near, far)));
        if (!v_any(active))
            return active;
    }
    for (vmask moved = active;
         v_any(moved);) { // a ray that has left a convex leaf is never in it again
        vmask last = moved;
        moved = v_mask_none();
        for (unsigned rest = part->cut; rest; rest &= rest - 1) {
            int i = __builtin_ctz(rest);
            if (!(all->known >> i & 1) &&
                !v_any(v_and(last, near_leaf(&sharp->leaf[i], vec_along(all->o, all->d, near)))))
                continue;
            const struct span *s = span_at(all, sharp, i);
            vmask in = v_and(s->met, v_and(v_cmp_le(s->in, near), v_cmp_lt(near, s->out)));
            in = v_and(in, last);
            near = v_select(in, s->out, near);
            moved = v_or(moved, in);
        }
    }
    *t = near;
    return v_and(active, v_cmp_lt(near, far));
}

vmask sharp_enter(const struct sharp *sharp, struct vec o, struct vec d, vmask active, vfloat near,
                  vfloat far, vfloat *t) {
    struct spans all;
    all.o = o, all.d = d, all.active = active, all.known = 0;
    vmask found = v_mask_none();
    *t = far;
    for (int i = 0; i < sharp->parts; i++) {
        vfloat at = far;
        vmask in = enter_part(&all, sharp, &sharp->part[i], near, *t, &at);
        *t = v_select(in, at, *t);
        found = v_or(found, in);
    }
    return found;
}

static vfloat leaf_distance(const struct primitive *s, struct vec p) {
    if (s->type == SHAPE_PLANE)
        return height_over(s, p);
    p = to_local(s, p);
    if ((int)s->type == SHAPE_CAPSULE)
        return vec_norm(off_axis(p, s)) - v_splat(s->a);
    return distance_at(p, s, v_mask_none());
}

static struct vec leaf_normal(const struct primitive *s, struct vec p) {
    if (s->type == SHAPE_PLANE)
        return vec_set(s->normal);
    p = to_local(s, p);
    if ((int)s->type != SHAPE_CAPSULE)
        return turned_back(s, normal_on(p, s));
    p = off_axis(p, s);
    return turned_back(s, vec_scale(p, v_splat(1.0f) / v_max(vec_norm(p), v_splat(1e-18f))));
}

// What decides at a point. f: the field; most: of the leaves that have a material; leaf, node: that leaf.
struct decision {
    vfloat f, most, leaf, node;
};

// Returns the lanes where a is before b: at its f the lesser, or the first of equals in the tree.
static inline vmask decides(vfloat a, vfloat node, vfloat b, vfloat other) {
    return v_or(v_cmp_lt(a, b), v_andnot(v_cmp_lt(b, a), v_cmp_lt(node, other)));
}

static struct decision in_part(const struct sharp *sharp, const struct sharp_part *part,
                               struct vec p, vmask found) {
    vfloat lowest = v_splat(-INFINITY);
    struct decision d = {lowest, lowest, v_splat(-1.0f), v_splat(INFINITY)};
    for (unsigned rest = part->kept | part->cut; rest; rest &= rest - 1) {
        int i = __builtin_ctz(rest);
        const struct primitive *leaf = &sharp->leaf[i];
        bool away = part->cut >> i & 1;
        if (away && !v_any(v_and(found, near_leaf(leaf, p))))
            continue;
        vfloat h = leaf_distance(leaf, p), node = v_splat(leaf->index);
        if (away)
            h = v_splat(0.0f) - h;
        d.f = v_max(d.f, h);
        if (leaf->index < 0)
            continue;
        vmask more = decides(v_splat(0.0f) - h, node, v_splat(0.0f) - d.most, d.node);
        d.most = v_select(more, h, d.most);
        d.leaf = v_select(more, v_splat((float)i), d.leaf);
        d.node = v_select(more, node, d.node);
    }
    return d;
}

struct field_surface sharp_surface(const struct sharp *sharp, struct vec p, vmask found) {
    vfloat zero = v_splat(0.0f), far = v_splat(INFINITY);
    struct decision d = {far, far, v_splat(-1.0f), far};
    for (int k = 0; k < sharp->parts; k++) {
        unsigned kept = sharp->part[k].kept;
        if (kept && !v_any(v_and(found, near_leaf(&sharp->leaf[__builtin_ctz(kept)], p))))
            continue;
        struct decision mine = in_part(sharp, &sharp->part[k], p, found);
        vmask less = decides(mine.f, mine.node, d.f, d.node);
        d.f = v_select(less, mine.f, d.f);
        d.leaf = v_select(less, mine.leaf, d.leaf);
        d.node = v_select(less, mine.node, d.node);
    }
    struct field_surface all = {{zero, zero, zero}, {zero, zero, zero}, zero, zero};
    for (int k = 0; k < sharp->leaves; k++) {
        vmask here = v_and(found, v_cmp_eq(d.leaf, v_splat((float)k)));
        if (!v_any(here))
            continue;
        const struct primitive *leaf = &sharp->leaf[k];
        all.normal = vec_select(here, leaf_normal(leaf, p), all.normal);
        all.color = vec_select(here, vec_set(leaf->color), all.color);
        all.reflectivity = v_select(here, v_splat(10.0f * leaf->share), all.reflectivity);
        all.shininess = v_select(here, v_splat(leaf->shininess), all.shininess);
    }
    return all;
}
