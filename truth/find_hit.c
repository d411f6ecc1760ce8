// The first hit of a ray. Solids are intersected with proof, and so is a Mandelbulb in the picture of the exact surface
// (bulb/); in the other pictures a fractal is marched (J. C. Hart, "Sphere tracing", The
// Visual Computer 12 (1996)) with the scene's own hit distance and steps.
#include "bulb/bulb_hit.h"
#include "trace.h"

struct dd distance_to_scene(const struct prepared *prepared, const struct dd p[3], bool fractals,
                            int *nearest) {
    struct dd least = dd_from(INFINITY);
    for (int i = 0; i < prepared->model.shape_count; i++) {
        if (fractals && !is_fractal(prepared->model.shapes[i].type))
            continue;
        struct dd distance = distance_to(&prepared->solids[i], p);
        if (dd_less(distance, least)) {
            least = distance;
            *nearest = i;
        }
    }
    return least;
}

static void point_on(const struct ray_q *ray, struct ivq s, struct ivq point[3]) {
    for (int i = 0; i < 3; i++)
        point[i] = add_q(ray->o[i], mul_q(s, ray->d[i]));
}

// The ray's origin and unit direction in double-double: the middles of their enclosures.
static void unit_ray(const struct ray_q *ray, struct dd o[3], struct dd d[3]) {
    for (int i = 0; i < 3; i++) {
        o[i] = dd_from_quad(mid_q(ray->o[i]));
        d[i] = dd_from_quad(mid_q(ray->d[i]));
    }
    struct dd length = dd_norm(d);
    for (int i = 0; i < 3; i++)
        d[i] = dd_div(d[i], length);
}

// Returns the s up to which a hit counts, or −1 for none. A march ends where it stands outside of the bounds, but not
// before its first step: from outside, that step must lead inside.
static struct ivq find_reach(const struct prepared *prepared, const struct ray_q *ray) {
    double bounds = prepared->model.march.bounds_radius;
    struct ivq beyond = sub_q(norm_sq_q(ray->o), square_q(point_q(bounds)));
    if (beyond.hi <= 0)
        return leave_ball(ray, bounds);
    int nearest;
    struct dd o[3], d[3], p[3];
    unit_ray(ray, o, d);
    dd_along(o, distance_to_scene(prepared, o, false, &nearest), d, p);
    return dd_less(dd_norm(p), dd_from(bounds)) ? leave_ball(ray, bounds) : point_q(-1);
}

static void set_hit(struct hit *hit, struct first_q first) {
    hit->shape = first.shape;
    hit->face = first.face;
    hit->s = first.s;
    hit->status = first.proved ? PROVED : UNDECIDED;
    hit->normal_sure = first.face_sure;
    for (int i = 0; i < 3; i++)
        hit->cell[i] = first.cell[i];
}

// Finds the first solid in doubles and its s in quads; what the field of a group decides, in doubles alone, as it costs
// twenty times as much in quads. If doubles do not decide, everything is done in quads.
static void solve_hit(const struct prepared *prepared, const struct ray_q *ray, struct ivq reach,
                      struct hit *hit) {
    const struct solid *solids = prepared->solids;
    int count = prepared->model.shape_count;
    struct ray_d rough;
    for (int i = 0; i < 3; i++) {
        rough.o[i] = narrow(ray->o[i]);
        rough.d[i] = narrow(ray->d[i]);
    }
    struct first_d first = first_hit_d(solids, count, &rough, narrow(reach), &hit->evals);
    if (first.proved && first.shape < 0) {
        hit->shape = -1;
        hit->status = PROVED;
        return;
    }
    bool enough = first.proved && (solids[first.shape].shape->type == SHAPE_GROUP ||
                                   (first.inside && prepared->model.features.groups > 0));
    if (first.proved && !first.inside && !enough) {
        struct first_q fine = first_hit_q(solids + first.shape, 1, ray, reach, &hit->evals);
        if (fine.proved && fine.shape == 0 && !fine.inside && fine.s.hi >= first.s.lo &&
            fine.s.lo <= first.s.hi) {
            fine.shape = first.shape;
            set_hit(hit, fine);
            return;
        }
    }
    if (enough || (!first.proved && first.gave_up)) {
        struct first_q rest = {.s = widen(first.s),
                               .shape = first.shape,
                               .face = first.face,
                               .proved = enough,
                               .face_sure = enough && first.face_sure};
        for (int i = 0; i < 3; i++)
            rest.cell[i] = first.cell[i];
        set_hit(hit, rest);
        return;
    }
    set_hit(hit, first_hit_q(solids, count, ray, reach, &hit->evals));
}

// Returns whether the march meets a fractal before t = limit; `last` is its last step. The march uses the whole
// scene's distance. Near another surface that the exact ray does not hit, it uses the fractals' alone.
static bool march_fractals(const struct prepared *prepared, const struct ray_q *ray, double limit,
                           struct hit *hit, struct dd *t, double *last) {
    const struct limits *march = &prepared->model.march;
    struct dd o[3], d[3], p[3];
    unit_ray(ray, o, d);
    *t = dd_from(0);
    for (int step = 0; step < march->max_steps; step++) {
        int nearest = -1;
        dd_along(o, *t, d, p);
        if (step > 0 && dd_norm(p).hi > march->bounds_radius)
            return false;
        struct dd distance = distance_to_scene(prepared, p, false, &nearest);
        hit->evals++;
        if (distance.hi < march->hit_distance &&
            !is_fractal(prepared->model.shapes[nearest].type)) {
            if (t->hi + distance.hi >= limit - march->hit_distance)
                return false;
            distance = distance_to_scene(prepared, p, true, &nearest);
        }
        *t = dd_add(*t, distance);
        *last = distance.hi;
        if (distance.hi < march->hit_distance) {
            hit->shape = nearest;
            return true;
        }
        if (t->hi > limit)
            return false;
    }
    return false;
}

void find_hit(const struct prepared *prepared, const struct ray_q *ray, struct hit *hit) {
    *hit = (struct hit){
        .shape = -1, .face = FACE_NONE, .normal_sure = true, .evals = 1}; // of the bounds
    struct ivq reach = find_reach(prepared, ray), length = sqrt_q(norm_sq_q(ray->d));
    if (!(length.lo > 0))
        return; // the direction may be 0: undecided
    if (reach.hi < 0)
        hit->status = PROVED;
    else
        solve_hit(prepared, ray, reach, hit);
    if (prepared->exact && reach.hi >= 0)
        first_bulb(prepared, ray, reach, hit);
    hit->t = mul_q(hit->s, length);
    if (prepared->fractals && !prepared->exact) {
        struct dd t;
        double last;
        struct hit other = *hit;
        double limit = hit->shape >= 0 ? (double)mid_q(hit->t) : INFINITY;
        if (march_fractals(prepared, ray, limit, hit, &t, &last)) {
            quad at = (quad)t.hi + (quad)t.lo;
            hit->t = (struct ivq){at - (quad)fabs(last), at + (quad)fabs(last)};
            hit->s = div_q((struct ivq){at, at}, length);
        } else {
            other.evals = hit->evals;
            *hit = other;
        }
        hit->status = hit->status > MARCHED ? MARCHED : hit->status;
    }
    struct ivq s = hit->s;
    if (hit->status == UNDECIDED) // the picture shows the nearest sure surface, if there is one
        s.lo = s.hi;
    if (!(s.hi - s.hi == 0))
        hit->shape = -1;
    hit->shown_t = mid_q(hit->status == UNDECIDED ? mul_q(s, length) : hit->t);
    if (hit->shape >= 0)
        point_on(ray, s, hit->point);
}
