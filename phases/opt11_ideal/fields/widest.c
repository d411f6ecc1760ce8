// The least ratio of a group's field to t along shadow rays. Spheres of a union bound it from above in closed form; a
// march goes only where a ball says that it may be less: PROOFS.md, 10.
#include "groups/field.h"

#include "fields/balls.h"
#include "fields/rays.h"
#include "fields/spheres.h"

#define ROOM (1.0f / 64)

// march_ratio() looks at points no farther apart than these parts of t and of the group's radius, so narrower dips are missed.
// It stays below the cap: 300 such steps at most, and after every second one a bracket.
#define FALLING 0.05f
#define RISING 0.125f
#define OF_RADIUS 0.1f
#define LOOKS 16.0f // in a bracket, which each makes 0.62 times as wide
enum { MOST_WIDEST_STEPS = 4096 };

// A bracket of a ray's least ratio: `ratio` at mid is less than at low and high. It is halved `left` times, roughly.
struct bracket {
    vfloat low, mid, high, ratio, left;
};

// Takes the ratio at t, a point between low and high.
static void narrow_bracket(struct bracket *b, vmask rays, vfloat t, vfloat ratio) {
    vmask less = v_cmp_lt(ratio, b->ratio), before = v_cmp_lt(t, b->mid);
    vfloat edge = v_select(less, b->mid, t);
    vmask ends = v_and(rays, v_or(v_and(less, before), v_andnot(v_or(less, before), rays)));
    b->high = v_select(ends, edge, b->high);
    b->low = v_select(v_andnot(ends, rays), edge, b->low);
    b->mid = v_select(v_and(rays, less), t, b->mid);
    b->ratio = v_select(v_and(rays, less), ratio, b->ratio);
    b->left = v_select(rays, b->left - v_splat(1.0f), b->left);
}

// Returns the next point to look at: within the longer part, by the golden section (J. Kiefer, 1953).
static vfloat within_bracket(const struct bracket *b) {
    vfloat before = b->mid - b->low, behind = b->high - b->mid;
    vfloat longer = v_select(v_cmp_gt(before, behind), v_splat(0.0f) - before, behind);
    return v_madd(v_splat(0.381966f), longer, b->mid);
}

// Returns the lesser of `best` and the least ratio between near and far. The field falls no faster than t grows, so no
// ratio is below `goal` within the next (f − goal·t)/(1 + goal). Where the ratio fell and rises again, its least is looked
// for between.
static vfloat march_ratio(const struct field *field, const struct program *program, struct vec o,
                          struct vec d, vmask active, vfloat near, vfloat far, vfloat best,
                          vfloat room) {
    vfloat zero = v_splat(0.0f), one = v_splat(1.0f), at = near, on = near;
    vfloat least = v_splat(field->least), fell = zero, last = near, ratio_last = v_splat(INFINITY);
    struct bracket b = {near, near, near, zero, zero};
    o = (struct vec){o.x + v_splat(field->centre[0]), o.y + v_splat(field->centre[1]),
                     o.z + v_splat(field->centre[2])};
    for (int step = 0; step < MOST_WIDEST_STEPS && v_any(active); step++) {
        ACTIVE(v_count(active));
        COUNT(widest_step, call);
        struct vec p = vec_along(o, d, at);
        vfloat f;
        field_values(program, &p, 1, &f);
        vfloat ratio = f / at;
        best = v_select(active, v_min(best, v_max(ratio, zero)), best);
        vmask looks = v_cmp_gt(b.left, zero), goes = v_andnot(looks, active);
        narrow_bracket(&b, looks, at, ratio);
        vfloat goal = best - room, next = v_nmadd(goal, at, f) / (one + goal);
        if (field->bend > 0) {
            vfloat slope = (f - ratio_last * last) / v_max(at - last, v_splat(1e-12f));
            vfloat bent = bent_step(v_nmadd(goal, at, f), slope - goal, at - last, field->bend);
            vmask known = v_and(v_cmp_gt(slope, v_splat(-1.0f)), v_cmp_gt(at, last));
            next = v_select(known, v_max(next, bent), next);
        }
        vmask rises = v_cmp_gt(v_nmadd(ratio_last, at, f), least);
        vfloat small = v_select(rises, v_splat(RISING), v_splat(FALLING)) * at;
        small = v_min(small, v_splat(OF_RADIUS * field->radius));
        next = v_max(next, v_max(small, v_splat(field->floor)));
        vmask turned = v_and(v_and(goes, rises),
                             v_and(v_cmp_gt(last, fell), v_cmp_lt(ratio_last - room, best)));
        b.low = v_select(turned, fell, b.low);
        b.mid = v_select(turned, last, b.mid);
        b.high = v_select(turned, at, b.high);
        b.ratio = v_select(turned, ratio_last, b.ratio);
        b.left = v_select(turned, v_splat(LOOKS), b.left);
        // Where it rises, `fell` is where it was least so far.
        fell = v_select(goes, v_select(rises, at, last), fell);
        last = v_select(goes, at, last);
        ratio_last = v_select(goes, ratio, ratio_last);
        on = v_select(goes, at + next, on);
        looks = v_cmp_gt(b.left, zero);
        vmask ended = v_andnot(looks, v_cmp_ge(last, far));
        active = v_andnot(v_or(ended, v_cmp_ge(zero, best)), active);
        at = v_select(active, v_select(looks, within_bracket(&b), v_min(on, far)), at);
    }
    return best;
}

// The same for a blend of spheres, whose slope is known: d(f/t)/dt is `turn`/t². Where that changes its sign between two
// points the least ratio is near the secant's root, and the ray then goes on from the second.
static vfloat march_spheres_ratio(const struct field *field, const struct met_ball *met, int count,
                                  vmask active, vfloat near, vfloat far, vfloat best, vfloat room) {
    vfloat zero = v_splat(0.0f), one = v_splat(1.0f), t = near, from = near, last = zero, on = zero;
    // On the surface that it leaves, a ray's field is 0 but for rounding: near to it that counts in the ratio.
    vfloat own = blend_along(field, met, count, zero).f;
    own = v_select_or_zero(v_cmp_lt(v_abs(own), v_splat(4.0f * field->least)), own);
    for (int step = 0; step < MOST_WIDEST_STEPS && v_any(active); step++) {
        ACTIVE(v_count(active));
        COUNT(widest_step, call);
        // These quotients need not wait for the field: a larger goal makes a step shorter.
        vfloat per = rcp_newton(t), per_goal = v_rcp_approx(one + best) * v_splat(1 - 0x1p-10f);
        struct field_along a = blend_along(field, met, count, t);
        a.f = a.f - own;
        best = v_select(active, v_min(best, v_max(a.f * per, zero)), best);
        vfloat goal = best - room, excess = v_nmadd(goal, t, a.f);
        vfloat turn = v_msub(a.slope, t, a.f);
        vmask back = v_cmp_gt(on, zero); // a secant's root
        vfloat next = bent_root(excess, a.slope - goal, a.bend);
        next = v_max(next, excess * per_goal);
        vfloat part = v_select(v_cmp_ge(a.slope, goal), v_splat(0.3f), v_splat(0.2f));
        vfloat least = v_max(part * t, v_splat(0.05f * field->grain));
        vfloat root = v_madd((from - t) * v_rcp_approx(turn - last), turn, t);
        vmask over = v_andnot(back, v_and(v_cmp_lt(last, zero), v_cmp_gt(turn, zero)));
        vfloat ahead = v_select(back, on, t + v_max(next, least));
        // A ray is done if no ratio before the end can be below its best: what bends down is least at an end.
        vfloat rest = far - t, half_bend = a.bend * v_splat(0.5f * (1 + 0x1p-10f));
        vfloat at_end =
            v_madd(v_nmadd(half_bend, rest, a.slope - best), rest, v_nmadd(best, t, a.f));
        vmask done = v_andnot(v_or(back, over), v_cmp_ge(at_end, zero));
        on = v_select_or_zero(over, ahead);
        active =
            v_and(active, v_and(v_or(v_or(back, over), v_cmp_lt(t, far)), v_cmp_gt(best, zero)));
        active = v_andnot(done, active);
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

// A cone of slope q about each ray: 1 − q² and its inverse.
struct cone_slope {
    vfloat q, a, per;
};

static inline struct cone_slope cone_of_slope(vfloat q) {
    vfloat a = v_nmadd(q, q, v_splat(1.0f));
    return (struct cone_slope){q, a, v_splat(1.0f) / a};
}

// Sets where the cones meet a ball of that radius, as cone_span() does, or somewhat farther apart.
static inline vmask meet_ball(const struct met_ball *m, const struct cone_slope *c, float radius,
                              vfloat *in, vfloat *out) {
    vfloat zero = v_splat(0.0f), r = v_splat(radius), rest = v_madd(c->q, m->along, r);
    vfloat inside = v_msub(rest, rest, c->a * m->square), b = v_madd(c->q, r, m->along);
    vfloat root = root_above(inside);
    *in = (b - root) * c->per;
    *out = (b + root) * c->per;
    return v_cmp_gt(inside, zero);
}

static vfloat widest_of_balls(const struct field *f, struct vec o, struct vec d, vmask active,
                              vfloat near, vfloat far, vfloat best, vfloat room) {
    // 64: see field_surface()
    int balls = f->balls.level[0].count, count = 0, kept = 0;
    const float *radii = f->balls.level[0].radius;
    _Alignas(64) int list[balls + LANES];
    _Alignas(64) struct met_ball met[balls + 1];
    vfloat per_share = v_splat(1 / f->share), zero = v_splat(0.0f), in, out;
    struct cone_slope cone = cone_of_slope(best * per_share);
    struct beam b = beam_of(o, d, active, near, far);
    int listed = list_balls(f, &b, v_reduce_max(v_select_or_zero(active, cone.q)), f->wider, list);
    for (int i = 0; i < listed; i++) {
        struct met_ball *m = &met[count];
        *m = met_by(f, list[i], o, d);
        vmask meets = meet_ball(m, &cone, radii[list[i]] + f->wider, &in, &out);
        meets = v_and(v_and(meets, active), v_and(v_cmp_lt(in, far), v_cmp_gt(out, near)));
        if (!v_any(meets))
            continue;
        count++;
        if (!(f->sphere[list[i]] > 0))
            continue;
        if (!v_any(v_and(meets, meet_ball(m, &cone, f->sphere[list[i]], &in, &out))))
            continue;
        best = v_select(active, ratio_of_sphere(f, list[i], o, d, near, far, best), best);
        if (!v_any(v_and(active, v_cmp_gt(best, zero))))
            return best;
    }
    cone = cone_of_slope(best * per_share);
    vfloat begin = v_splat(INFINITY), end = v_splat(-INFINITY);
    float more = less_drop(f, count);
    active = v_and(active, v_cmp_gt(best, zero));
    for (int i = 0; i < count; i++) {
        vmask meets = meet_ball(&met[i], &cone, radii[met[i].ball] + more, &in, &out);
        meets = v_and(meets, v_and(v_cmp_lt(in, far), v_cmp_gt(out, near)));
        begin = v_select(meets, v_min(begin, in), begin);
        end = v_select(meets, v_max(end, out), end);
    }
    begin = v_max(begin, near);
    end = v_min(end, far);
    active = v_and(active, v_cmp_lt(begin, end));
    if (!v_any(active))
        return best;
    for (int i = 0; i < count; i++) {
        vmask meets = meet_ball(&met[i], &cone, radii[met[i].ball] + f->wider, &in, &out);
        meets = v_and(meets, v_and(v_cmp_lt(in, end), v_cmp_gt(out, begin)));
        if (v_any(v_and(meets, active)))
            met[kept++] = met[i];
    }
    if (kept == 0 || (kept == 1 && f->sphere[met[0].ball] > 0))
        return best;
    if (f->blend > 0 && kept <= MOST_SPHERES)
        return march_spheres_ratio(f, met, kept, active, begin, end, best, room);
    for (int i = 0; i < kept; i++)
        list[i] = met[i].ball;
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
    if (field->balls.levels > 0 && v_all(v_or(narrow, v_not(active)))) {
        while (v_any(active)) { // rays that begin far from each other have other balls
            vmask here = field->blend > 0 ? points_near(o, active, field->grain) : active;
            vfloat found = widest_of_balls(field, o, d, here, near, far, best, room);
            best = v_select(here, found, best);
            active = v_andnot(here, active);
        }
        return best;
    }
    return march_ratio(field, field->program, o, d, active, near, far, best, room);
}
