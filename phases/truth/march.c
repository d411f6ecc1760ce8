// The first hit of a ray, proved where it can be, and the Mandelbulb's, marched: J. C. Hart, "Sphere
// tracing", The Visual Computer 12 (1996), by the scene's own hit distance and steps.
#include "sdf.h"
#include "trace.h"

struct dd distance_to_scene(const struct prepared *prepared, const struct dd p[3], int *nearest) {
    struct dd least = dd_from(INFINITY);
    for (int i = 0; i < prepared->model.shape_count; i++) {
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

// Origin and unit direction in double-double.
static void unit_ray(const struct ray_q *ray, struct dd o[3], struct dd d[3]) {
    for (int i = 0; i < 3; i++) {
        o[i] = dd_from_quad(mid_q(ray->o[i]));
        d[i] = dd_from_quad(mid_q(ray->d[i]));
    }
    struct dd length = dd_norm(d);
    for (int i = 0; i < 3; i++)
        d[i] = dd_div(d[i], length);
}

// The s up to which a hit counts. A march is over as soon as it stands outside of the bounds, but
// not before its first step: from outside, that step must lead inside. {−1}: it does not.
static struct ivq find_reach(const struct prepared *prepared, const struct ray_q *ray) {
    double bounds = prepared->model.march.bounds_radius;
    struct ivq beyond = sub_q(square_q(ray->o), sqr_q(point_q(bounds)));
    if (beyond.hi <= 0)
        return leave_ball(ray, bounds);
    int nearest;
    struct dd o[3], d[3], p[3];
    unit_ray(ray, o, d);
    dd_along(o, distance_to_scene(prepared, o, &nearest), d, p);
    return dd_less(dd_norm(p), dd_from(bounds)) ? leave_ball(ray, bounds) : point_q(-1);
}

static void take(struct hit *hit, struct first_q first) {
    hit->shape = first.shape;
    hit->face = first.face;
    hit->s = first.s;
    hit->status = first.proved ? PROVED : UNDECIDED;
    hit->normal_sure = first.face_sure;
    for (int i = 0; i < 3; i++)
        hit->cell[i] = first.cell[i];
}

// In doubles who is first, in quads where; all in quads if doubles do not decide.
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
    if (first.proved && !first.inside) {
        struct first_q fine = first_hit_q(solids + first.shape, 1, ray, reach, &hit->evals);
        if (fine.proved && fine.shape == 0 && !fine.inside && fine.s.hi >= first.s.lo &&
            fine.s.lo <= first.s.hi) {
            fine.shape = first.shape;
            take(hit, fine);
            return;
        }
    }
    if (!first.proved && first.worn) {
        struct first_q rest = {.s = widen(first.s), .shape = first.shape, .face = first.face};
        for (int i = 0; i < 3; i++)
            rest.cell[i] = first.cell[i];
        take(hit, rest);
        return;
    }
    take(hit, first_hit_q(solids, count, ray, reach, &hit->evals));
}

// A Mandelbulb before t = `limit`: marched through the whole scene's distances; where another
// surface's hit distance would stop the march though its true surface is not reached, on by the
// Mandelbulb's own.
static bool march_bulbs(const struct prepared *prepared, const struct ray_q *ray, double limit,
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
        struct dd distance = distance_to_scene(prepared, p, &nearest);
        hit->evals++;
        if (distance.hi < march->hit_distance &&
            prepared->model.shapes[nearest].type != SHAPE_MANDELBULB) {
            if (t->hi + distance.hi >= limit - march->hit_distance)
                return false;
            distance = dd_from(INFINITY);
            for (int i = 0; i < prepared->model.shape_count; i++) {
                if (prepared->model.shapes[i].type != SHAPE_MANDELBULB)
                    continue;
                struct dd own = distance_to(&prepared->solids[i], p);
                if (dd_less(own, distance)) {
                    distance = own;
                    nearest = i;
                }
            }
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
    *hit =
        (struct hit){.shape = -1, .face = FACE_NONE, .normal_sure = true, .evals = 1}; // the bounds
    struct ivq reach = find_reach(prepared, ray), length = root_q(square_q(ray->d));
    if (!(length.lo > 0))
        return; // no direction: undecided
    if (reach.hi < 0)
        hit->status = PROVED;
    else
        solve_hit(prepared, ray, reach, hit);
    hit->t = mul_q(hit->s, length);
    if (prepared->bulbs) {
        struct dd t;
        double last;
        struct hit other = *hit;
        double limit = hit->shape >= 0 ? (double)mid_q(hit->t) : INFINITY;
        if (march_bulbs(prepared, ray, limit, hit, &t, &last)) {
            quad at = (quad)t.hi + (quad)t.lo;
            hit->t = (struct ivq){at - (quad)fabs(last), at + (quad)fabs(last)};
            hit->s = div_q((struct ivq){at, at}, length);
        } else {
            other.evals = hit->evals;
            *hit = other;
        }
        hit->status = hit->status > CONVERGED ? CONVERGED : hit->status;
    }
    struct ivq s = hit->s;
    if (hit->status == UNDECIDED) // shown where the nearest sure surface is, if there is one
        s.lo = s.hi;
    if (!(s.hi - s.hi == 0))
        hit->shape = -1;
    hit->guess = mid_q(hit->status == UNDECIDED ? mul_q(s, length) : hit->t);
    if (hit->shape >= 0)
        point_on(ray, s, hit->point);
}

static void unit(struct ivq v[3]) {
    struct ivq length = root_q(square_q(v));
    for (int i = 0; i < 3; i++)
        v[i] = div_q(v[i], length);
}

// By the scene's own rule, forward differences over normal_step, in double-double: closer by, the
// gradient of a fractal's estimate says nothing of what is seen.
static void bulb_normal(const struct prepared *prepared, const struct ivq point[3],
                        struct ivq n[3]) {
    struct dd p[3], slope[3], step = dd_from(prepared->model.march.normal_step);
    int nearest;
    for (int i = 0; i < 3; i++)
        p[i] = dd_from_quad(mid_q(point[i]));
    struct dd here = distance_to_scene(prepared, p, &nearest);
    for (int i = 0; i < 3; i++) {
        struct dd beside[3] = {p[0], p[1], p[2]};
        beside[i] = dd_add(p[i], step);
        slope[i] = dd_sub(distance_to_scene(prepared, beside, &nearest), here);
    }
    struct dd length = dd_norm(slope);
    for (int i = 0; i < 3; i++) {
        struct dd x = dd_div(slope[i], length);
        n[i].lo = n[i].hi = (quad)x.hi + (quad)x.lo;
    }
}

static void side_normal(struct ivq n[3], int code) { // 2·axis + upper
    for (int i = 0; i < 3; i++)
        n[i] = point_q(i == code / 2 ? (code & 1 ? 1 : -1) : 0);
}

// The gradient of the shape's own surface at the local point p.
static void surface_normal(const struct shape *shape, int face, const struct ivq p[3],
                           struct ivq n[3]) {
    if (face >= FACE_CELL) {
        side_normal(n, face - FACE_CELL);
        return;
    }
    struct ivq rho = root_q(add_q(sqr_q(p[0]), sqr_q(p[2])));
    switch (shape->type) {
    case SHAPE_BOX: side_normal(n, face); return;
    case SHAPE_PLANE:
        for (int i = 0; i < 3; i++)
            n[i] = point_q(shape->plane.normal[i]);
        break;
    case SHAPE_ROUNDED_BOX: // away from the nearest point of the box that is grown
        for (int i = 0; i < 3; i++) {
            struct ivq half = point_q(shape->box.half_size[i]), over = sub_q(p[i], half),
                       under = add_q(p[i], half);
            n[i] = (struct ivq){(under.lo < 0 ? under.lo : 0) + (over.lo > 0 ? over.lo : 0),
                                (under.hi < 0 ? under.hi : 0) + (over.hi > 0 ? over.hi : 0)};
        }
        break;
    case SHAPE_OCTAHEDRON:
        for (int i = 0; i < 3; i++)
            n[i] = point_q(face >> i & 1 ? 1 : -1);
        break;
    case SHAPE_CONE:
        if (face != FACE_SIDE) {
            side_normal(n, face == FACE_TOP ? 3 : 2);
            return;
        }
        n[0] = div_q(p[0], rho);
        n[1] = div_q(sub_q(point_q(shape->cone.bottom_radius), point_q(shape->cone.top_radius)),
                     point_q(2 * shape->cone.half_height));
        n[2] = div_q(p[2], rho);
        break;
    case SHAPE_TORUS: {
        struct ivq ring = div_q(sub_q(rho, point_q(shape->torus.major_radius)), rho);
        n[0] = mul_q(p[0], ring);
        n[1] = p[1];
        n[2] = mul_q(p[2], ring);
        break;
    }
    default:
        for (int i = 0; i < 3; i++)
            n[i] = p[i];
    }
    unit(n);
}

static bool finite_vector(const struct ivq v[3]) {
    for (int i = 0; i < 3; i++)
        if (!(v[i].lo - v[i].lo == 0) || !(v[i].hi - v[i].hi == 0))
            return false;
    return true;
}

void find_normal(const struct prepared *prepared, const struct ray_q *ray, struct hit *hit) {
    const struct solid *solid = &prepared->solids[hit->shape];
    const struct shape *shape = solid->shape;
    struct ivq moved[3], local[3], own[3];
    if (shape->type == SHAPE_MANDELBULB)
        bulb_normal(prepared, hit->point, hit->normal);
    else {
        for (int i = 0; i < 3; i++)
            moved[i] = sub_q(hit->point[i], point_q(shape->position[i]));
        for (int i = 0; i < 3; i++) {
            local[i] = solid->turned ? dot_q(solid->turn_q[i], moved) : moved[i];
            if (shape->repeat[i] > 0)
                local[i] = sub_q(local[i], mul_q(point_q(shape->repeat[i]), point_q(hit->cell[i])));
        }
        surface_normal(shape, hit->face, local, own);
        for (int i = 0; i < 3; i++) {
            struct ivq column[3];
            for (int j = 0; j < 3; j++)
                column[j] = solid->turn_q[j][i];
            hit->normal[i] = solid->turned ? dot_q(column, own) : own[i];
        }
    }
    struct ivq facing = dot_q(ray->d, hit->normal);
    if (!finite_vector(hit->normal)) { // no direction, as at a point: towards the ray
        for (int i = 0; i < 3; i++)
            hit->normal[i] = neg_q(ray->d[i]);
        unit(hit->normal);
        hit->normal_sure = false;
    } else if (mid_q(facing) > 0)
        for (int i = 0; i < 3; i++)
            hit->normal[i] = neg_q(hit->normal[i]);
    if (has_zero_q(facing))
        hit->normal_sure = false;
}
