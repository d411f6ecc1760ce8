// Rays against a group's field: a march within brackets that closed forms give. See fields/rays.h.
#include "groups/field.h"

#include "fields/balls.h"
#include "fields/rays.h"
#include "fields/spheres.h"

#include <string.h>

vfloat field_distance(const struct field *field, struct vec p) {
    int count = field->balls.level[0].count;
    if (field->blend > 0 && count <= MOST_SPHERES) {
        vfloat distance[MOST_SPHERES], none[MOST_SPHERES];
        if (count < 1)
            __builtin_unreachable();
        for (int i = 0; i < count; i++) {
            COUNT(group_shape, call);
            struct vec v = vec_sub(p, ball_centre(field, i));
            vfloat square = v_max(vec_dot(v, v), v_splat(1e-30f));
            distance[i] = v_msub(square, v_rsqrt_newton(square), v_splat(field->sphere[i]));
            none[i] = v_splat(0.0f);
        }
        return blend_of(field, distance, none, count).f;
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

enum { MOST_FIELD_STEPS = 4096 };

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

// The same for a blend of spheres, whose slope is known: it is above the parabola of bent_root(), and near the surface
// Newton's last step is right to `least`. guess: where a ray may come to the surface; it is looked at first. As the field
// bends down by no more than `bend` backwards, too, there is no surface within 2·fall/bend before one.
static vmask march_spheres(const struct field *field, const struct met_ball *met, int count,
                           vmask active, vfloat near, vfloat far, vfloat guess, vfloat *t) {
    vfloat zero = v_splat(0.0f), least = v_splat(field->least);
    vfloat curved = v_splat(field->bend / (8 * field->least));
    vmask found = v_mask_none(), leapt = v_and(v_cmp_gt(guess, near), v_cmp_lt(guess, far));
    vfloat at = v_select(leapt, guess, near);
    for (int steps = 0; steps < MOST_FIELD_STEPS && v_any(active); steps++) {
        ACTIVE(v_count(active));
        COUNT(field_step, call);
        struct field_along a = blend_along(field, met, count, at);
        vfloat fall = v_max(zero - a.slope, zero), size = v_abs(a.f);
        vmask straight = v_cmp_lt(curved * size * size, fall * fall * fall);
        vmask reached = v_cmp_lt(steps > 0 ? size : a.f, least);
        vfloat last = a.f * rcp_newton(v_max(fall, v_splat(1e-6f))), root = at + last;
        vmask clear = v_cmp_lt((root - near) * a.bend, (fall + fall) * v_splat(0.99f));
        reached = v_or(v_andnot(leapt, reached), v_and(straight, v_or(clear, v_not(leapt))));
        reached = v_and(active, reached);
        vfloat end = at + v_select(v_and(straight, v_or(leapt, v_cmp_ge(a.f, zero))), last, zero);
        *t = v_select(reached, end, *t);
        found = v_or(found, reached);
        active = v_andnot(v_or(reached, v_andnot(leapt, v_cmp_ge(at, far))), active);
        vmask above = v_cmp_gt(a.f, zero); // within the next step then nothing is met
        vfloat next = v_select(above, v_max(a.f, bent_root(a.f, a.slope, a.bend)), a.f);
        active = v_andnot(v_andnot(leapt, v_and(above, v_cmp_ge(next, far - at))), active);
        vfloat ahead = at + v_min(next, far - at);
        if (steps < 2) {
            vmask again =
                v_and(v_and(leapt, clear), v_and(v_cmp_gt(root, near), v_cmp_lt(root, far)));
            at = v_select(leapt, v_select(again, root, near), ahead);
            leapt = again;
        } else {
            at = v_select(leapt, near, ahead);
            leapt = v_mask_none();
        }
    }
    return v_and(found, v_cmp_lt(*t, far));
}

// Returns which rays come to the surface between begin and end, by the listed children.
static vmask enter_segment(const struct field *f, const struct met_ball *met, int count,
                           struct vec o, struct vec d, vmask active, vfloat begin, vfloat end,
                           vfloat guess, vfloat *t) {
    if (count == 0)
        return v_mask_none();
    if (count == 1 && f->sphere[met[0].ball] > 0) {
        int ball = met[0].ball;
        float shrink = f->sphere[ball] - f->balls.level[0].radius[ball];
        struct cone_span s = ball_span(f, ball, shrink, o, d, v_splat(0.0f));
        *t = v_select(active, v_max(s.in, begin), *t);
        return v_and(v_and(active, s.met), v_and(v_cmp_gt(s.out, begin), v_cmp_lt(s.in, end)));
    }
    if (f->blend > 0 && count <= MOST_SPHERES)
        return march_spheres(f, met, count, active, begin, end, guess, t);
    int list[count];
    for (int i = 0; i < count; i++)
        list[i] = met[i].ball;
    _Alignas(64) struct step room[f->program->length];
    struct program part = part_of(f, list, count, room);
    return march_field(f, &part, o, d, active, begin, end, t);
}

// Sets where each ray is first in a ball, from near on, and where it leaves that: both far, if nowhere.
__attribute__((always_inline)) static inline void first_stretch(const struct met_ball *met,
                                                                const vfloat *half, int count,
                                                                vfloat near, vfloat far,
                                                                vfloat *begin, vfloat *end) {
    *begin = *end = far;
    for (int i = 0; i < count; i++) {
        vfloat in = v_max(met[i].along - half[i], near), out = met[i].along + half[i];
        vmask first = v_and(v_cmp_gt(out, near), v_cmp_lt(in, *begin));
        *begin = v_select(first, in, *begin);
        *end = v_select(first, v_min(out, far), *end);
    }
}

enum { FEW = 5 }; // so many balls have straight-line code

// Rays within the balls alone need be marched: from one ball to the next, in the order in which a ray enters them. There a
// child has a part if its ball is in reach, made larger by f->wider.
__attribute__((always_inline)) static inline vmask
enter_listed(const struct field *f, const int *list, int count, struct vec o, struct vec d,
             vmask active, vfloat near, vfloat far, vfloat guess, vfloat *t) {
    const float *radii = f->balls.level[0].radius;
    _Alignas(64) struct met_ball met[count], kept[count];
    _Alignas(64) vfloat reach[count], half[count];
    vfloat zero = v_splat(0.0f), within = far, none = v_splat(-INFINITY);
    vmask meets = v_mask_none(), found = meets;
    for (int i = 0; i < count; i++) {
        vfloat radius = v_splat(radii[list[i]]);
        met[i] = met_by(f, list[i], o, d);
        meets = v_or(meets, v_cmp_lt(met[i].square, radius * radius));
    }
    if (!v_any(v_and(meets, active)))
        return found;
    for (int i = 0; i < count; i++) { // within a child a ray is within the union, too
        vfloat child = v_splat(f->sphere[list[i]] * (1 - 0x1p-9f)),
               in = v_msub(child, child, met[i].square);
        vfloat first = met[i].along - v_sqrt_below(v_max(in, v_splat(1e-30f)));
        vmask enters = v_and(v_cmp_gt(in, zero), v_cmp_gt(first, near));
        within = v_select(enters, v_min(first, within), within);
    }
    int needed = 0;
    for (int i = 0; i < count; i++) {
        vfloat radius = v_splat(radii[list[i]] + f->wider),
               inside = v_msub(radius, radius, met[i].square);
        vfloat root = root_above(inside);
        vmask in = v_and(v_cmp_gt(inside, zero), v_cmp_lt(met[i].along - root, within));
        int at = count > FEW ? needed : i;
        reach[at] = v_select(in, root, none);
        met[at] = met[i];
        needed += v_any(v_and(in, active));
    }
    float less = less_drop(f, needed);
    count = count > FEW ? needed : count;
    for (int i = 0; i < count; i++) {
        vfloat radius = v_splat(radii[met[i].ball] + less),
               inside = v_msub(radius, radius, met[i].square);
        half[i] = v_select(v_cmp_gt(inside, zero), root_above(inside), none);
    }
    while (v_any(active)) {
        vfloat begin, end;
        first_stretch(met, half, count, near, far, &begin, &end);
        active = v_and(active, v_cmp_lt(begin, end));
        if (!v_any(active))
            break;
        int parts = 0;
        for (int i = 0; i < count; i++) {
            vmask in = v_and(v_cmp_lt(met[i].along - reach[i], end),
                             v_cmp_gt(met[i].along + reach[i], begin));
            kept[parts] = met[i];
            parts += v_any(v_and(in, active));
        }
        vmask here = enter_segment(f, kept, parts, o, d, active, begin, end, guess, t);
        found = v_or(found, here);
        active = v_andnot(here, active);
        near = end;
    }
    return found;
}

// The same; a count that is known has straight-line code.
static vmask enter_balls(const struct field *f, const int *list, int count, struct vec o,
                         struct vec d, vmask active, vfloat near, vfloat far, vfloat guess,
                         vfloat *t) {
    switch (count) {
    case 0: return v_mask_none();
    case 1: return enter_listed(f, list, 1, o, d, active, near, far, guess, t);
    case 2: return enter_listed(f, list, 2, o, d, active, near, far, guess, t);
    case 3: return enter_listed(f, list, 3, o, d, active, near, far, guess, t);
    case 4: return enter_listed(f, list, 4, o, d, active, near, far, guess, t);
    case 5: return enter_listed(f, list, 5, o, d, active, near, far, guess, t);
    default: return enter_listed(f, list, count, o, d, active, near, far, guess, t);
    }
}

// Returns which of the spheres i to i + LANES − 1 the frustum may meet.
static unsigned spheres_in_frustum(const struct sphere_array *s, int i, const struct vec axes[3],
                                   const float centre[3], const float edges[4],
                                   const float sides[4]) {
    struct vec p = {v_load(s->x + i), v_load(s->y + i), v_load(s->z + i)};
    vfloat x = vec_dot(axes[0], p) + v_splat(centre[0]),
           y = vec_dot(axes[1], p) + v_splat(centre[1]);
    vfloat z = vec_dot(axes[2], p) + v_splat(centre[2]), r = v_load(s->radius + i);
    float size = fabsf(centre[0]) + fabsf(centre[1]) + fabsf(centre[2]);
    r = v_madd(r, v_splat(1 + 1e-5f), v_splat(2e-6f * size)); // for rounding
    vfloat out = v_splat(0.0f) - z;
    out = v_max(out, v_msub(v_splat(edges[0]), z, x) * v_splat(1 / sides[0]));
    out = v_max(out, v_nmadd(v_splat(edges[1]), z, x) * v_splat(1 / sides[1]));
    out = v_max(out, v_msub(v_splat(edges[2]), z, y) * v_splat(1 / sides[2]));
    out = v_max(out, v_nmadd(v_splat(edges[3]), z, y) * v_splat(1 / sides[3]));
    int count = s->count - i < LANES ? s->count - i : LANES;
    return v_mask_bits(v_and(v_cmp_lt(out, r), v_mask_first(count)));
}

bool field_in_frustum(const struct field *f, const struct vec axes[3], const float centre[3],
                      const float edges[4], const float sides[4]) {
    const struct sphere_array *balls = &f->balls.level[0], *nodes = &f->balls.level[1];
    int of_nodes = f->balls.levels > 1 ? nodes->count : 1;
    for (int k = 0; k < of_nodes; k += LANES) {
        unsigned in = 1;
        if (f->balls.levels > 1)
            in = spheres_in_frustum(nodes, k, axes, centre, edges, sides);
        for (; in; in &= in - 1) {
            int i = (k + __builtin_ctz(in)) * BVH_WIDTH, end = i + BVH_WIDTH;
            for (; i < end && i < balls->count; i += LANES)
                if (spheres_in_frustum(balls, i, axes, centre, edges, sides))
                    return true;
        }
    }
    return false;
}

// A ray's hit is not far from where the two packets before it lead: that is looked at first.
static vfloat expected_hit(const struct field_rays *r, int before) {
    vfloat none = v_splat(-INFINITY);
    if (before == 0)
        return none;
    vfloat step = v_splat(0.0f);
    if (before > 1)
        step = v_select_or_zero(r[-2].met, r[-1].t - r[-2].t);
    return v_select(r[-1].met, r[-1].t + step, none);
}

enum { MOST_OF_ROW = 10 };

// Copies the listed balls, so that they stand side by side.
static void gather_balls(const struct sphere_array *from, const int *list,
                         struct sphere_array *to) {
    for (int i = 0; i < to->count; i++) {
        to->x[i] = from->x[list[i]];
        to->y[i] = from->y[list[i]];
        to->z[i] = from->z[list[i]];
        to->radius[i] = from->radius[list[i]];
    }
}

// A tube about camera rays from o, as long as that of the row.
static inline struct beam beam_in_row(const struct beam *row, struct vec d, vmask active) {
    struct beam b = *row;
    int lane = __builtin_ctz(v_mask_bits(active));
    b.d = (struct vec){of_lane(d.x, lane), of_lane(d.y, lane), of_lane(d.z, lane)};
    struct vec turn = vec_sub(d, b.d);
    b.wide = v_sqrt(v_max_of_lanes(v_select_or_zero(active, vec_dot(turn, turn)))) * b.far;
    return b;
}

void field_row(const struct field *f, struct vec o, struct field_rays *rays, int packets) {
    vfloat zero = v_splat(0.0f), radius = v_splat(f->radius), away = vec_norm(o), apart = zero;
    struct vec axis = rays[packets / 2].d;
    axis = (struct vec){of_lane(axis.x, 0), of_lane(axis.y, 0), of_lane(axis.z, 0)};
    for (int i = 0; i < packets; i++) {
        struct vec turn = vec_sub(rays[i].d, axis);
        apart = v_max(apart, vec_dot(turn, turn));
        rays[i].met = v_mask_none();
    }
    struct beam b = {o, axis, v_max_of_lanes(v_sqrt(apart)) * (away + radius),
                     v_max(away - radius, zero), away + radius};
    _Alignas(64) int list[f->balls.level[0].count + LANES];
    int count = list_balls(f, &b, 0, f->wider, list);
    // A packet meets fewer.
    _Alignas(64) int kept[count + LANES];
    int room = (count + LANES) / LANES * LANES;
    _Alignas(64) float spheres[4][room];
    struct sphere_array row = {count, spheres[0], spheres[1], spheres[2], spheres[3]};
    if (count > MOST_OF_ROW)
        gather_balls(&f->balls.level[0], list, &row);
    for (int i = 0; count > 0 && i < packets; i++) {
        struct field_rays *r = &rays[i];
        vfloat before = zero - vec_dot(o, r->d), in = zero;
        struct vec c =
            vec_along(o, r->d, before); // nearest to the group's centre: see hit/solids.h
        vfloat half = v_sqrt(v_max(v_msub(radius, radius, vec_dot(c, c)), zero));
        vmask active = v_and(v_cmp_gt(half, zero), v_cmp_gt(before + half, zero));
        active = v_and(r->active, active);
        if (!v_any(active))
            continue;
        vfloat near = v_max(zero - half, zero - before);
        int listed = count;
        if (count > MOST_OF_ROW) {
            struct beam narrow = beam_in_row(&b, r->d, active);
            listed = 0;
            for (int k = 0; k < count; k += LANES) {
                vmask met = spheres_in_beam(&row, k, &narrow, 0, f->wider);
                v_compress_store_int(met, list + k, kept + listed);
                listed += v_count(met);
            }
        }
        r->met = enter_balls(f, count > MOST_OF_ROW ? kept : list, listed, c, r->d, active, near,
                             half, expected_hit(r, i) - before, &in);
        r->t = before + in;
        r->point = vec_along(c, r->d, in);
        r->met = v_and(r->met, v_cmp_gt(r->t, zero));
    }
}

vmask field_enter(const struct field *field, struct vec o, struct vec d, vmask active, vfloat near,
                  vfloat far, vfloat *t) {
    if (field->balls.levels > 0) {
        _Alignas(64) int list[field->balls.level[0].count + LANES];
        struct beam b = beam_of(o, d, active, near, far);
        int count = list_balls(field, &b, 0, field->wider, list);
        return enter_balls(field, list, count, o, d, active, near, far, v_splat(-INFINITY), t);
    }
    return march_field(field, field->program, o, d, active, near, far, t);
}
