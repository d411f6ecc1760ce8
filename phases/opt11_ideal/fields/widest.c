// The least ratio of a group's field to t along shadow rays. Spheres of a union bound it from above in closed form; a
// march goes only where a ball says that it may be less: PROOFS.md, 10.
#include "groups/field.h"

#include "fields/balls.h"
#include "fields/rays.h"
#include "fields/spheres.h"

#define ROOM (1.0f / 64)
#define DESCENT 0x1p-3f
enum { MOST_WIDEST_STEPS = 256 };

// Returns the lesser of `best` and the least ratio between near and far. The field falls no faster than t grows, so no
// ratio is below `goal` within the next (f − goal·t)/(1 + goal). The goal is so little below the best that the result is
// at most `room` too large, and about room² at a smooth minimum.
static vfloat march_ratio(const struct field *field, const struct program *program, struct vec o,
                          struct vec d, vmask active, vfloat near, vfloat far, vfloat best,
                          vfloat room) {
    vfloat zero = v_splat(0.0f), one = v_splat(1.0f), t = near;
    vfloat last = zero, from = zero;
    o = (struct vec){o.x + v_splat(field->centre[0]), o.y + v_splat(field->centre[1]),
                     o.z + v_splat(field->centre[2])};
    for (int step = 0; step < MOST_WIDEST_STEPS && v_any(active); step++) {
        ACTIVE(v_count(active));
        COUNT(widest_step, call);
        struct vec p = vec_along(o, d, t);
        vfloat f;
        field_values(program, &p, 1, &f);
        best = v_select(active, v_min(best, v_max(f / t, zero)), best);
        vfloat goal = best - room, slope = (f - last) / v_max(t - from, v_splat(1e-12f));
        vfloat excess = v_nmadd(goal, t, f), next = excess / (one + goal);
        if (field->bend > 0) {
            vfloat bent = bent_step(excess, slope - goal, t - from, field->bend);
            next = v_select(v_cmp_gt(slope, v_splat(-1.0f)), v_max(next, bent), next);
        }
        // Where the ratio grows, as above the own surface, or only just does not, what is small beside t or the group is
        // passed.
        vfloat ratio = f / t;
        vmask away = v_cmp_ge(step > 0 ? slope : ratio, goal);
        vfloat small = v_max(v_splat(0.1f) * t, v_splat(0x1p12f * field->least));
        next = v_max(next, v_select(away, small, v_splat(0x1p-6f) * t));
        last = f;
        from = v_select(active, t, zero);
        active = v_and(active, v_and(v_cmp_lt(t, far), v_cmp_gt(best, zero)));
        t = v_select(active, v_min(t + next, far), t);
    }
    return best;
}

// The same for a blend of spheres, whose slope is known: d(f/t)/dt is `turn`/t². Where that changes its sign between two
// points the least ratio is near the secant's root, and the ray then goes on from the second.
static vfloat march_spheres_ratio(const struct field *field, const int *list, int count,
                                  struct vec o, struct vec d, vmask active, vfloat near, vfloat far,
                                  vfloat best, vfloat room) {
    vfloat zero = v_splat(0.0f), one = v_splat(1.0f), t = near, from = near, last = zero, on = zero;
    // On the surface that it leaves, a ray's field is 0 but for rounding: near to it that counts in the ratio.
    vfloat own = blend_along(field, list, count, o, d, zero).f;
    own = v_select_or_zero(v_cmp_lt(v_abs(own), v_splat(4.0f * field->least)), own);
    for (int step = 0; step < MOST_WIDEST_STEPS && v_any(active); step++) {
        ACTIVE(v_count(active));
        COUNT(widest_step, call);
        // These quotients need not wait for the field: a larger goal makes a step shorter.
        vfloat per = one / t, per_goal = one / (one + best - room);
        struct field_along a = blend_along(field, list, count, o, d, t);
        a.f = a.f - own;
        best = v_select(active, v_min(best, v_max(a.f * per, zero)), best);
        vfloat goal = best - room, excess = v_nmadd(goal, t, a.f);
        vfloat turn = v_msub(a.slope, t, a.f);
        vmask back = v_cmp_gt(on, zero); // a secant's root
        vfloat next = bent_root(excess, a.slope - goal, a.bend);
        next = v_max(next, excess * per_goal);
        vfloat least = v_select(v_cmp_ge(a.slope, goal), v_splat(0.1f), v_splat(DESCENT)) * t;
        vfloat root = v_madd((from - t) * v_rcp_approx(turn - last), turn, t);
        vmask over = v_andnot(back, v_and(v_cmp_lt(last, zero), v_cmp_gt(turn, zero)));
        vfloat ahead = v_select(back, on, t + v_max(next, least));
        on = v_select_or_zero(over, ahead);
        active =
            v_and(active, v_and(v_or(v_or(back, over), v_cmp_lt(t, far)), v_cmp_gt(best, zero)));
        last = v_select_or_zero(v_cmp_lt(next, least), v_zero_where(back, turn));
        from = t;
        t = v_select(active, v_min(v_select(over, root, ahead), far), t);
    }
    return best;
}

// Returns the lesser of `best` and the ratio of a sphere where the ray's tangent touches it, or at the end before that.
static vfloat ratio_of_sphere(const struct field *f, int i, struct vec o, struct vec d, vfloat near,
                              vfloat far, vfloat best) {
    vfloat zero = v_splat(0.0f), radius = v_splat(f->sphere[i]);
    struct vec v = vec_sub(ball_centre(f, i), o);
    vfloat along = vec_dot(v, d), square = vec_dot(v, v);
    struct vec aside = vec_along(v, d, zero - along);
    vfloat across = v_sqrt(vec_dot(aside, aside)), power = v_nmadd(radius, radius, square);
    vfloat tangent = v_sqrt(v_max(power, zero));
    vfloat cosine = v_madd(along, tangent, across * radius); // times square
    vfloat touch = v_select(v_cmp_gt(cosine, zero), tangent * square / cosine, far);
    vfloat t = v_min(v_max(touch, near), far);
    vfloat rise = v_madd(t, t - along - along, power);
    vfloat root = v_sqrt(v_max(v_madd(radius, radius, rise), zero));
    vfloat ratio = v_splat(f->program->scale) * rise / ((root + radius) * t);
    return v_min(best, v_max(ratio, zero));
}

static vfloat widest_of_balls(const struct field *f, struct vec o, struct vec d, vmask active,
                              vfloat near, vfloat far, vfloat best, vfloat room) {
    // 64: see field_surface()
    _Alignas(64) int list[f->balls.level[0].count + 1], kept = 0;
    struct beam b = beam_of(o, d, active, near, far);
    vfloat per_share = v_splat(1 / f->share);
    float q = v_reduce_max(v_select_or_zero(active, best * per_share));
    int count = list_balls(f, &b, q, f->wider, list);
    for (int i = 0; i < count; i++) {
        if (!(f->sphere[list[i]] > 0))
            continue;
        vfloat ratio = ratio_of_sphere(f, list[i], o, d, near, far, best);
        best = v_select(active, ratio, best);
        if (!v_any(v_and(active, v_cmp_gt(best, v_splat(0.0f)))))
            return best;
    }
    vfloat begin = v_splat(INFINITY), end = v_splat(-INFINITY);
    float more = less_drop(f, count);
    active = v_and(active, v_cmp_gt(best, v_splat(0.0f)));
    for (int i = 0; i < count; i++) {
        struct cone_span s = ball_span(f, list[i], more, o, d, best * per_share);
        vmask met = v_and(s.met, v_and(v_cmp_lt(s.in, far), v_cmp_gt(s.out, near)));
        begin = v_select(met, v_min(begin, s.in), begin);
        end = v_select(met, v_max(end, s.out), end);
    }
    begin = v_max(begin, near);
    end = v_min(end, far);
    active = v_and(active, v_cmp_lt(begin, end));
    for (int i = 0; i < count; i++) {
        struct cone_span s = ball_span(f, list[i], f->wider, o, d, best * per_share);
        vmask met = v_and(s.met, v_and(v_cmp_lt(s.in, end), v_cmp_gt(s.out, begin)));
        if (v_any(v_and(met, active)))
            list[kept++] = list[i];
    }
    if (kept == 0 || (kept == 1 && f->sphere[list[0]] > 0))
        return best;
    if (f->blend > 0 && kept <= MOST_SPHERES)
        return march_spheres_ratio(f, list, kept, o, d, active, begin, end, best, room);
    _Alignas(64) struct step steps[f->program->length];
    struct program part = part_of(f, list, kept, steps);
    return march_ratio(f, &part, o, d, active, begin, end, best, room);
}

vfloat field_widest(const struct field *field, struct vec o, struct vec d, vmask active,
                    vfloat near, vfloat far, vfloat best, float lit) {
    // Only where the group's sphere meets a cone in which the field may be below best·t.
    vfloat q = best * v_splat(1 / field->share);
    struct vec v = vec_scale(o, v_splat(-1.0f));
    struct cone_span s = cone_span(v, v_splat(field->radius), d, q);
    vmask narrow = v_cmp_gt(v_nmadd(q, q, v_splat(1.0f)), v_splat(1e-3f));
    near = v_select(narrow, v_max(near, s.in), near);
    far = v_select(narrow, v_min(far, s.out), far);
    active = v_and(active, v_or(v_not(narrow), s.met));
    active = v_and(v_and(active, v_cmp_lt(near, far)), v_cmp_gt(best, v_splat(0.0f)));
    if (!v_any(active))
        return best;
    vfloat room = v_splat(ROOM * (lit < 1.0f ? lit : 1.0f));
    if (field->balls.levels > 0 && v_all(v_or(narrow, v_not(active))))
        return widest_of_balls(field, o, d, active, near, far, best, room);
    return march_ratio(field, field->program, o, d, active, near, far, best, room);
}
