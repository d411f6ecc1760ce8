// See hit/sharp.h.
#include "hit/sharp.h"
#include "hit/solids.h"
#include "types/sdf.h"

// The part of a ray in a convex leaf.
struct span {
    vfloat in, out;
    vmask met;
};

// Where a ray enters the cylinder if it does so between the ends, else the half ball there. a, b, root: of the cylinder's
// quadratic.
static vmask capsule_end(struct vec c, struct vec d, vfloat a, vfloat b, vfloat root,
                         const struct primitive *s, vfloat *t) {
    vfloat zero = v_splat(0.0f), high = v_splat(s->c);
    vfloat side = (zero - b - root) / a, y = v_madd(side, d.y, c.y);
    c.y = c.y - v_min(v_max(y, zero - high), high);
    vfloat along = vec_dot(c, d), power = vec_dot(c, c) - v_splat(s->a * s->a);
    vfloat in_ball = v_msub(along, along, power);
    vmask between = v_cmp_le(v_abs(y), high);
    *t = v_select(between, side, zero - along - v_sqrt(v_max(in_ball, zero)));
    return v_or(between, v_cmp_ge(in_ball, zero));
}

static vmask pass_capsule(struct vec c, struct vec d, struct vec back, const struct primitive *s,
                          vfloat *in, vfloat *back_in) {
    vfloat a = v_max(v_madd(d.x, d.x, d.z * d.z), v_splat(1e-12f)), zero = v_splat(0.0f);
    vfloat b = v_madd(c.x, d.x, c.z * d.z);
    vfloat away = v_madd(c.x, c.x, v_msub(c.z, c.z, v_splat(s->a * s->a)));
    vfloat inside = v_msub(b, b, a * away), root = v_sqrt(v_max(inside, zero));
    vmask met = v_cmp_ge(inside, zero);
    if (!v_any(met))
        return met;
    met = v_and(met, capsule_end(c, d, a, b, root, s, in));
    return v_and(met, capsule_end(c, back, a, zero - b, root, s, back_in));
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
        slab(c.x, inverse_of(d.x), s->size[0], in, &out);
        slab(c.y, inverse_of(d.y), s->size[1], in, &out);
        slab(c.z, inverse_of(d.z), s->size[2], in, &out);
        *back_in = zero - out;
        return v_and(near, v_cmp_ge(out, *in));
    }
    struct vec back = {zero - d.x, zero - d.y, zero - d.z};
    if ((int)s->type == SHAPE_CAPSULE)
        return v_and(near, pass_capsule(c, d, back, s, in, back_in));
    vfloat far = v_splat(INFINITY);
    near = enter_nearby(c, d, far, far, NULL, s, near, in);
    return enter_nearby(c, back, far, far, NULL, s, near, back_in);
}

static struct span span_of(const struct primitive *s, struct vec o, struct vec d, vmask active) {
    vfloat zero = v_splat(0.0f), infinite = v_splat(INFINITY);
    struct span span = {zero - infinite, infinite, active};
    if (s->type == SHAPE_PLANE) {
        vfloat slope = add_dot(s->normal, d), t = height_over(s, o) / (zero - slope);
        vmask down = v_cmp_lt(slope, zero);
        span.in = v_select(down, t, span.in);
        span.out = v_select(down, infinite, t);
        return span;
    }
    o = to_local(s, o);
    d = turned(s, d);
    vfloat before = zero - vec_dot(o, d);
    struct vec c = vec_along(o, d, before);
    vfloat square = vec_dot(c, c);
    span.met = v_and(active, v_cmp_lt(square, v_splat(s->bound_sq)));
    if (!v_any(span.met))
        return span;
    vfloat half = v_sqrt(v_max(v_splat(s->bound_sq) - square, zero)), in = zero, out = zero;
    span.met = pass_leaf(c, d, half, s, span.met, &in, &out);
    span.in = before + in;
    span.out = before - out;
    return span;
}

// Returns which rays are inside of the group behind t, where they come to leaf i.
static vmask inside_behind(const struct sharp *sharp, const struct span *span, vfloat t, int i) {
    vmask stack[SHARP_LEAVES];
    int top = 0;
    for (int k = 0; k < sharp->steps; k++) {
        int step = sharp->step[k];
        if (step < 0) {
            vmask last = stack[--top], *to = &stack[top - 1];
            *to = step == SHARP_AND  ? v_and(*to, last)
                  : step == SHARP_OR ? v_or(*to, last)
                                     : v_andnot(last, *to);
        } else if (step == i)
            stack[top++] = sharp->removes[i] ? v_mask_none() : v_mask_all();
        else
            stack[top++] = v_and(span[step].met,
                                 v_and(v_cmp_le(span[step].in, t), v_cmp_lt(t, span[step].out)));
    }
    return stack[0];
}

vmask sharp_near(const struct sharp *sharp, struct vec p, vmask points) {
    vmask near = v_mask_none();
    for (int i = 0; i < sharp->leaves; i++) {
        const struct primitive *s = &sharp->leaf[i];
        struct vec to = vec_sub(p, vec_set(s->position));
        if (s->type == SHAPE_PLANE)
            return points;
        if (sharp->guard[i] < 0)
            near = v_or(near, v_cmp_lt(vec_dot(to, to), v_splat(s->bound_sq)));
    }
    return v_and(near, points);
}

vmask sharp_enter(const struct sharp *sharp, struct vec o, struct vec d, vmask active, vfloat near,
                  vfloat far, vfloat *t) {
    struct span span[SHARP_LEAVES];
    for (int i = 0; i < sharp->leaves; i++) {
        vmask use = sharp->guard[i] < 0 ? active : span[sharp->guard[i]].met;
        span[i].met = v_mask_none();
        if (v_any(use))
            span[i] = span_of(&sharp->leaf[i], o, d, use);
    }
    vmask found = v_mask_none();
    vfloat first = far;
    for (int i = 0; i < sharp->leaves; i++) {
        if (!v_any(span[i].met))
            continue;
        vfloat at = sharp->removes[i] ? span[i].out : span[i].in;
        vmask may = v_and(span[i].met, v_and(v_cmp_ge(at, near), v_cmp_lt(at, first)));
        if (!v_any(may))
            continue;
        may = v_and(may, inside_behind(sharp, span, at, i));
        first = v_select(may, at, first);
        found = v_or(found, may);
    }
    *t = first;
    return found;
}
