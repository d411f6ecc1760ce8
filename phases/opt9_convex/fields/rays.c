// Rays against a group's field: a march within brackets that closed forms give. See fields/rays.h.
#include "groups/field.h"

#include "fields/balls.h"
#include "fields/rays.h"
#include "fields/spheres.h"

#include <string.h>

static struct vec in_group(const struct field *f, struct vec p) {
    return (struct vec){p.x + v_splat(f->centre[0]), p.y + v_splat(f->centre[1]),
                        p.z + v_splat(f->centre[2])};
}

vfloat field_distance(const struct field *field, struct vec p) {
    int list[MOST_SPHERES], count = field->balls.level[0].count;
    if (field->blend > 0 && count <= MOST_SPHERES) {
        struct vec still = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
        for (int i = 0; i < count; i++)
            list[i] = i;
        return blend_along(field, list, count, p, still, v_splat(0.0f)).f;
    }
    p = in_group(field, p);
    vfloat f;
    field_values(field->program, &p, 1, &f);
    return f;
}

// The distance to a group as core/shape_distances.h asks for it.
vfloat field_at(const struct local_ray *a, vfloat t, struct vec p,
                const struct primitive *primitive, vmask live) {
    (void)a;
    (void)t;
    (void)live;
    return field_distance(primitive->field, p);
}

// The same of a blend of the listed spheres, closed: normals and materials are mixed by the weights.
static struct field_surface blend_surface(const struct field *field, const int *list, int count,
                                          struct vec p) {
    const struct program *program = field->program;
    vfloat e[MOST_SPHERES], zero = v_splat(0.0f), one = v_splat(1.0f), least = v_splat(INFINITY);
    struct vec g[MOST_SPHERES], n = {zero, zero, zero};
    if (count < 1)
        __builtin_unreachable();
    for (int i = 0; i < count; i++) {
        struct vec v = vec_sub(p, ball_centre(field, list[i]));
        vfloat square = v_max(vec_dot(v, v), v_splat(1e-30f)), per = v_rsqrt_newton(square);
        e[i] = v_msub(square, per, v_splat(field->sphere[list[i]]));
        g[i] = vec_scale(v, per);
        least = v_min(e[i], least);
    }
    for (int i = 0; i < count; i++)
        e[i] = (e[i] - least) * v_splat(field->per_blend);
    vfloat level = level_near(e, count), sum = one, kept = zero;
    for (int i = 0; i < count; i++) { // once more, to all bits
        vmask in = v_cmp_lt(e[i], level);
        sum = v_add_where(in, sum, e[i]);
        kept = v_add_where(in, kept, one);
    }
    level = sum / kept;
    struct field_surface all = {n, n, zero, zero};
    for (int i = 0; i < count; i++) {
        int step = field->first[field->balls.shape[list[i]]];
        const struct group_node *m = &program->nodes[program->steps[step].node];
        vfloat w = v_max(level - e[i], zero);
        n = vec_along(n, g[i], w);
        all.color = vec_along(all.color, vec_set(m->color), w);
        all.reflectivity = v_madd(w, v_splat(m->reflectivity), all.reflectivity);
        all.shininess = v_madd(w, v_splat(m->shininess), all.shininess);
    }
    all.normal = vec_scale(n, one / v_max(vec_norm(n), v_splat(1e-18f)));
    return all;
}

// Arrays of variable length are aligned as vectors: clang 14 takes the stack below them for aligned so, and passes vectors
// there.
struct field_surface field_surface(const struct field *field, struct vec p, vmask found) {
    _Alignas(64) struct step room[field->program->length];
    _Alignas(64) int list[field->balls.level[0].count + 1];
    struct program part = *field->program;
    if (field->balls.levels > 0) {
        struct vec still = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
        struct beam b = beam_of(p, still, found, v_splat(0.0f), v_splat(0.0f));
        int count = list_balls(field, &b, 0, field->wider, list);
        if (field->blend > 0 && count > 0 && count <= MOST_SPHERES)
            return blend_surface(field, list, count, p);
        if (count > 0)
            part = part_of(field, list, count, room);
    }
    struct field_part at = field_parts(&part, in_group(field, p));
    vfloat size = vec_norm(at.gradient);
    struct vec n = vec_scale(at.gradient, v_splat(1.0f) / v_max(size, v_splat(1e-18f)));
    return (struct field_surface){n, at.color, at.reflectivity, at.shininess};
}

enum { MOST_FIELD_STEPS = 512 };

// Marches from near to far. Two balls about points of a ray that are h apart leave nothing between them if the fields
// f there add up to h or more. With slope −s that is so for h = 2f/(1 + s): steps that long are tried, and taken back
// where it was not so (C. Balint and G. Valasek, "Accelerating sphere tracing", Eurographics 2018). Close to a surface a
// step goes where the secant is 0.
static vmask march_field(const struct field *field, const struct program *program, struct vec o,
                         struct vec d, vmask active, vfloat near, vfloat far, vfloat *t) {
    vfloat zero = v_splat(0.0f), one = v_splat(1.0f), at = near, before = zero, step = zero;
    vfloat least = v_splat(field->least), close = v_splat(1e-3f * field->radius);
    vmask found = v_mask_none();
    o = in_group(field, o);
    for (int steps = 0; steps < MOST_FIELD_STEPS && v_any(active); steps++) {
        ACTIVE(v_count(active));
        COUNT(field_step, call);
        struct vec p = vec_along(o, d, at);
        vfloat f;
        field_values(program, &p, 1, &f);
        vmask forth = v_cmp_gt(step, zero);
        vmask leapt =
            v_and(v_and(forth, v_cmp_gt(before, close)), v_cmp_lt(v_abs(f) + before, step));
        leapt = field->bend > 0 ? v_mask_none() : leapt;
        vmask reached = v_cmp_lt(steps > 0 ? v_abs(f) : f, least);
        reached = v_and(v_andnot(leapt, active), reached);
        found = v_or(found, reached);
        *t = v_select(reached, at, *t);
        active = v_andnot(v_or(reached, v_andnot(leapt, v_cmp_ge(at, far))), active);
        vfloat slope = v_select(forth, (before - f) / v_max(step, v_splat(1e-12f)), one);
        slope = v_min(v_max(slope, v_splat(-0.6f)), one);
        vmask near_by = v_cmp_lt(f, close);
        vfloat next = f * v_select(near_by, one, v_splat(1.9f)) /
                      v_select(near_by, v_max(slope, v_splat(0.25f)), v_splat(0.9f) + slope);
        if (field->bend > 0) {
            next = bent_step(f, v_splat(0.0f) - slope, step, field->bend);
            next = v_select(v_and(forth, v_cmp_gt(f, zero)), v_max(f, next), f);
        }
        next = v_min(v_select(leapt, before - step, next), far - at);
        at = at + next;
        step = v_select(leapt, zero, next);
        before = f;
    }
    return found;
}

// The same for a blend of spheres, whose slope is known: it is above the parabola of bent_step(), and near the surface
// Newton's last step is right to `least`.
static vmask march_spheres(const struct field *field, const int *list, int count, struct vec o,
                           struct vec d, vmask active, vfloat near, vfloat far, vfloat *t) {
    vfloat zero = v_splat(0.0f), at = near, least = v_splat(field->least);
    vfloat curved = v_splat(field->bend / (8 * field->least));
    vmask found = v_mask_none();
    for (int steps = 0; steps < MOST_FIELD_STEPS && v_any(active); steps++) {
        ACTIVE(v_count(active));
        COUNT(field_step, call);
        struct field_along a = blend_along(field, list, count, o, d, at);
        vfloat fall = v_max(zero - a.slope, zero), size = v_abs(a.f);
        vmask straight = v_cmp_lt(curved * size * size, fall * fall * fall);
        vmask reached = v_cmp_lt(steps > 0 ? size : a.f, least);
        vfloat last = v_select(straight, a.f / v_max(fall, v_splat(1e-6f)), zero);
        reached = v_and(active, v_or(reached, straight));
        *t = v_select(reached, at + v_select(v_cmp_lt(a.f, zero), zero, last), *t);
        found = v_or(found, reached);
        active = v_andnot(v_or(reached, v_cmp_ge(at, far)), active);
        vfloat next = bent_root(a.f, a.slope, a.bend);
        at = at + v_min(v_select(v_cmp_gt(a.f, zero), v_max(a.f, next), a.f), far - at);
    }
    return v_and(found, v_cmp_lt(*t, far));
}

// Returns which rays come to the surface between begin and end, by the listed children.
static vmask enter_segment(const struct field *f, int *list, int count, struct vec o, struct vec d,
                           vmask active, vfloat begin, vfloat end, vfloat *t) {
    if (count == 0)
        return v_mask_none();
    if (count == 1 && f->sphere[list[0]] > 0) {
        float shrink = f->sphere[list[0]] - f->balls.level[0].radius[list[0]];
        struct cone_span s = ball_span(f, list[0], shrink, o, d, v_splat(0.0f));
        *t = v_select(active, v_max(s.in, begin), *t);
        return v_and(v_and(active, s.met), v_and(v_cmp_gt(s.out, begin), v_cmp_lt(s.in, end)));
    }
    if (f->blend > 0 && count <= MOST_SPHERES)
        return march_spheres(f, list, count, o, d, active, begin, end, t);
    _Alignas(64) struct step room[f->program->length];
    struct program part = part_of(f, list, count, room);
    return march_field(f, &part, o, d, active, begin, end, t);
}

// Rays within the balls alone need be marched: from one ball to the next, in the order in which a ray enters them. There a
// child has a part if its ball is in reach, made larger by f->wider.
static vmask enter_balls(const struct field *f, struct vec o, struct vec d, vmask active,
                         vfloat near, vfloat far, vfloat *t) {
    _Alignas(64) int list[f->balls.level[0].count + 1], kept[f->balls.level[0].count + 1];
    struct beam b = beam_of(o, d, active, near, far);
    int listed = list_balls(f, &b, 0, f->wider, list), count = 0;
    _Alignas(64) struct cone_span ball[listed + 1], reach[listed + 1];
    vfloat straight = v_splat(0.0f), within = far;
    for (int i = 0; i < listed; i++) { // within a child a ray is within the union, too
        reach[i] = ball_span(f, list[i], f->wider, o, d, straight);
        float shrink = f->sphere[list[i]] * (1 - 0x1p-9f) - f->balls.level[0].radius[list[i]];
        struct cone_span child = ball_span(f, list[i], shrink, o, d, straight);
        vmask enters = v_and(child.met, v_cmp_gt(child.in, near));
        within = v_select(enters, v_min(child.in, within), within);
    }
    for (int i = 0; i < listed; i++) {
        vmask needed = v_and(v_and(reach[i].met, active), v_cmp_lt(reach[i].in, within));
        reach[count] = reach[i];
        list[count] = list[i];
        count += v_any(needed);
    }
    for (int i = 0; i < count; i++)
        ball[i] = ball_span(f, list[i], less_drop(f, count), o, d, straight);
    vmask found = v_mask_none();
    while (count > 0 && v_any(active)) {
        vfloat begin = far, end = far;
        int parts = 0;
        for (int i = 0; i < count; i++) {
            vfloat in = v_max(ball[i].in, near);
            vmask first =
                v_and(v_and(ball[i].met, v_cmp_gt(ball[i].out, near)), v_cmp_lt(in, begin));
            begin = v_select(first, in, begin);
            end = v_select(first, v_min(ball[i].out, far), end);
        }
        active = v_and(active, v_cmp_lt(begin, end));
        if (!v_any(active))
            break;
        for (int i = 0; i < count; i++) {
            vmask met = v_and(v_cmp_lt(reach[i].in, end), v_cmp_gt(reach[i].out, begin));
            if (v_any(v_and(v_and(reach[i].met, met), active)))
                kept[parts++] = list[i];
        }
        vmask here = enter_segment(f, kept, parts, o, d, active, begin, end, t);
        found = v_or(found, here);
        active = v_andnot(here, active);
        near = end;
    }
    return found;
}

vmask field_enter(const struct field *field, struct vec o, struct vec d, vmask active, vfloat near,
                  vfloat far, vfloat *t) {
    if (field->balls.levels > 0)
        return enter_balls(field, o, d, active, near, far, t);
    return march_field(field, field->program, o, d, active, near, far, t);
}
