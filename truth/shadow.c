// Shadows at a hit: the estimator of every phase, in double-double; the ideal soft shadow that it estimates; and the hard
// shadow.
#include "bulb/bulb_hit.h"
#include "groups/field.h"
#include "trace.h"

struct light_ray {
    const struct prepared *prepared;
    struct dd o[3], d[3]; // d of unit length
    double start, distance;
};

static struct dd distance_at(const struct light_ray *ray, const struct solid *solid, double t) {
    struct dd p[3];
    dd_along(ray->o, dd_from(t), ray->d, p);
    return distance_to(solid, p);
}

// The Mandelbulb's distance estimate in doubles, for the ideal shadow, which has no proof there.
static double bulb_distance(const struct dd local[3], const struct shape *shape) {
    double p[3] = {local[0].hi, local[1].hi, local[2].hi};
    double x = p[0], y = p[1], z = p[2], m = x * x + y * y + z * z, dz = 1.5;
    for (int i = 0; i < shape->mandelbulb.iterations; i++) {
        dz = 8.0 * m * m * m * sqrt(m) * dz + 1.0;
        double x2 = x * x, y2 = y * y, z2 = z * z, x4 = x2 * x2, y4 = y2 * y2, z4 = z2 * z2;
        double k3 = x2 + z2, k4 = k3 - y2, k1 = x4 + y4 + z4 - 6.0 * y2 * k3 + 2.0 * x2 * z2;
        double k2 = k3 > 0.0 ? 1.0 / (k3 * k3 * k3 * sqrt(k3)) : 0.0, k = y * k4 * k1 * k2;
        double b = x4 * x4 + z4 * z4 - 28.0 * x2 * z2 * (x4 + z4) + 70.0 * x4 * z4;
        x = p[0] + 64.0 * x * z * (x2 - z2) * (x4 - 6.0 * x2 * z2 + z4) * k;
        y = p[1] + k1 * k1 - 16.0 * y2 * k3 * k4 * k4;
        z = p[2] - 8.0 * b * k;
        m = x * x + y * y + z * z;
        if (m > shape->mandelbulb.bailout)
            break;
    }
    return m > 0.0 && isfinite(m) ? 0.25 * log(m) * sqrt(m) / dz : 0.0;
}

// The Mandelbox's, in doubles too.
static double box_distance(const struct dd local[3], const struct shape *shape) {
    double limit = shape->mandelbox.fold_limit, dr = 1.0;
    double inner_sq = shape->mandelbox.minimum_radius * shape->mandelbox.minimum_radius;
    double outer_sq = shape->mandelbox.fixed_radius * shape->mandelbox.fixed_radius;
    double w[3] = {local[0].hi, local[1].hi, local[2].hi};
    for (int i = 0; i < shape->mandelbox.iterations; i++) {
        for (int k = 0; k < 3; k++)
            w[k] = 2.0 * fmin(fmax(w[k], -limit), limit) - w[k];
        double m = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
        double factor = shape->mandelbox.scale * (outer_sq / fmin(fmax(m, inner_sq), outer_sq));
        for (int k = 0; k < 3; k++)
            w[k] = w[k] * factor + local[k].hi;
        dr = fabs(factor) * dr + 1.0;
    }
    return sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) / dr;
}

// Returns a solid's distance from the light ray at t, for the ideal shadow.
static double height_at(const struct light_ray *ray, const struct solid *solid, double t) {
    struct dd p[3], local[3];
    if (!is_fractal(solid->shape->type))
        return distance_at(ray, solid, t).hi;
    dd_along(ray->o, dd_from(t), ray->d, p);
    to_frame(solid, p, local);
    return solid->shape->type == SHAPE_MANDELBULB ? bulb_distance(local, solid->shape)
                                                  : box_distance(local, solid->shape);
}

// Improved soft shadow: I. Quilez, "soft shadows in raymarched SDFs" (iquilezles.org/articles/
// rmshadows), after S. Aaltonen's GDC 2018 talk. It takes the same steps as the phases.
static double estimated_shadow(const struct light_ray *ray) {
    const struct model *model = &ray->prepared->model;
    int nearest;
    struct dd least = dd_from(1), previous = dd_from(1e20), t = dd_from(ray->start), p[3];
    dd_along(ray->o, t, ray->d, p);
    for (int step = 0; step < model->march.max_steps; step++) {
        struct dd h = distance_to_scene(ray->prepared, p, false, &nearest);
        if (h.hi < model->march.hit_distance)
            break;
        struct dd square = dd_sqr(h), y = dd_div(square, dd_twofold(previous, 2));
        struct dd inside = dd_sub(square, dd_sqr(y)), from = dd_sub(t, y);
        if (inside.hi > 0 && from.hi > 0)
            least = dd_min(least, dd_div(dd_scale(dd_sqrt(inside), model->shadow_strength), from));
        previous = h;
        t = dd_add(t, h);
        dd_along(ray->o, t, ray->d, p);
        if (dd_norm(p).hi > model->march.bounds_radius)
            break;
    }
    return fmin(fmax(least.hi, 0.0), 1.0);
}

// Returns the least strength·h/t over [low, high] of a convex solid, or `best` if that is less. The distance h along a
// line is convex, so h/t falls, then rises: golden section (J. Kiefer, 1953).
static double least_ratio_convex(const struct light_ray *ray, const struct solid *solid, double low,
                                 double high, double best) {
    const double golden = 0.6180339887498949;
    double strength = ray->prepared->model.shadow_strength;
    double a = high - golden * (high - low), b = low + golden * (high - low);
    double at_a = strength * height_at(ray, solid, a) / a;
    double at_b = strength * height_at(ray, solid, b) / b;
    best = fmin(best, fmin(strength * height_at(ray, solid, low) / low,
                           strength * height_at(ray, solid, high) / high));
    for (int i = 0; i < 200 && best > 0; i++) {
        best = fmin(best, fmin(at_a, at_b));
        // h falls by no more than the length: the rest of the interval has no smaller ratio than this.
        double possible = fmin(at_a * a, at_b * b) - strength * (high - low);
        if (possible / high >= best - 1e-12)
            break;
        if (at_a < at_b) {
            high = b;
            b = a;
            at_b = at_a;
            a = high - golden * (high - low);
            at_a = strength * height_at(ray, solid, a) / a;
        } else {
            low = a;
            a = b;
            at_a = at_b;
            b = low + golden * (high - low);
            at_b = strength * height_at(ray, solid, b) / b;
        }
    }
    return best;
}

// The same for any solid, by branch and bound: h is 1-Lipschitz. Proved to 1e-4, then refined by golden section. A
// fractal's estimate is no bound; there it is searched to 1/1024.
static double least_ratio_any(const struct light_ray *ray, const struct solid *solid, double best) {
    enum { DEEPEST = 200 };
    double strength = ray->prepared->model.shadow_strength;
    double room = is_fractal(solid->shape->type) ? 1.0 / 1024 : 1e-4;
    double stack[DEEPEST][2] = {{ray->start, ray->distance}};
    double low = 0, high = -1;
    for (int depth = 1, rounds = 0; depth > 0 && rounds < 100000; rounds++) {
        double a = stack[depth - 1][0], b = stack[--depth][1];
        double m = 0.5 * (a + b), half = 0.5 * (b - a);
        double h = height_at(ray, solid, m), here = strength * h / m;
        if (h <= 0)
            return 0;
        if (here < best) {
            best = here;
            low = a;
            high = b;
        }
        if (h > half && strength * (h - half) / b >= best - room)
            continue;
        if (depth + 2 > DEEPEST || !(m > a && m < b))
            continue;
        stack[depth][0] = m; // the nearer half comes first
        stack[depth++][1] = b;
        stack[depth][0] = a;
        stack[depth++][1] = m;
    }
    return high > low ? least_ratio_convex(ray, solid, low, high, best) : best;
}

// Returns the least strength·h(t)/t between the start and the light, from 0 to 1.
static double ideal_shadow(const struct light_ray *ray) {
    double best = 1;
    if (!(ray->start < ray->distance))
        return 1;
    struct ray_d rough;
    for (int i = 0; i < 3; i++) {
        rough.o[i] = (struct ivd){ray->o[i].hi, ray->o[i].hi};
        rough.d[i] = (struct ivd){ray->d[i].hi, ray->d[i].hi};
    }
    for (int i = 0; i < ray->prepared->model.shape_count && best > 0; i++) {
        const struct solid *solid = &ray->prepared->solids[i];
        if (solid->shape->type == SHAPE_GROUP) {
            best = field_least_ratio(solid, &rough, ray->start, ray->distance,
                                     ray->prepared->model.shadow_strength, best);
            continue;
        }
        bool convex = !solid->repeated && solid->shape->type != SHAPE_TORUS &&
                      !is_fractal(solid->shape->type);
        best = convex ? least_ratio_convex(ray, solid, ray->start, ray->distance, best)
                      : least_ratio_any(ray, solid, best);
    }
    return fmax(best, 0);
}

// Whether a march towards the light meets a fractal.
static bool fractal_blocks(const struct light_ray *ray) {
    const struct model *model = &ray->prepared->model;
    for (int i = 0; i < model->shape_count; i++) {
        if (!is_fractal(model->shapes[i].type))
            continue;
        double t = ray->start;
        for (int step = 0; step < model->march.max_steps && t < ray->distance; step++) {
            double h = distance_at(ray, &ray->prepared->solids[i], t).hi;
            if (h < model->march.hit_distance)
                return true;
            t += h;
        }
    }
    return false;
}

// Computes the hard shadow: 0 if a surface within the bounds lies between the start and the light, else 1.
// Returns whether that is proved.
static enum status hard_shadow(const struct light_ray *light, const struct hit *hit,
                               const struct view *view, double *factor) {
    const struct prepared *prepared = light->prepared;
    struct ivq to_light[3], start = point_q(light->start);
    struct ray_q ray;
    struct ray_d rough;
    for (int i = 0; i < 3; i++)
        to_light[i] = sub_q(point_q(view->light_position[i]), hit->point[i]);
    struct ivq distance = sqrt_q(norm_sq_q(to_light));
    for (int i = 0; i < 3; i++) {
        ray.d[i] = div_q(to_light[i], distance);
        ray.o[i] = add_q(hit->point[i], mul_q(start, ray.d[i]));
        rough.o[i] = narrow(ray.o[i]);
        rough.d[i] = narrow(ray.d[i]);
    }
    struct ivq reach = sub_q(distance, start),
               edge = leave_ball(&ray, prepared->model.march.bounds_radius);
    if (edge.hi < reach.lo || edge.hi < 0)
        reach = edge;
    *factor = 1;
    if (reach.hi < 0)
        return PROVED;
    long evals = 0;
    int count = prepared->model.shape_count;
    struct first_d first = first_hit_d(prepared->solids, count, &rough, narrow(reach), &evals);
    bool proved = first.proved || first.inside, blocked = first.shape >= 0 || first.inside;
    // A group's hit is known in doubles: quads would know no more of the ray.
    if (!proved && prepared->model.shapes[hit->shape].type != SHAPE_GROUP) {
        struct first_q fine = first_hit_q(prepared->solids, count, &ray, reach, &evals);
        proved = fine.proved || fine.inside;
        blocked = fine.shape >= 0 || fine.inside;
    }
    enum status status = !proved ? UNDECIDED : prepared->exact ? PROVED : MARCHED;
    if (prepared->exact)
        blocked = blocked || bulb_blocks(prepared, &ray, double_above(reach.hi), &status);
    else if (prepared->fractals)
        blocked = blocked || fractal_blocks(light);
    else if (proved)
        status = PROVED;
    *factor = blocked ? 0 : 1;
    return status;
}

enum status find_shadow(const struct prepared *prepared, const struct hit *hit,
                        const struct view *view, double factor[SHADOW_KINDS]) {
    struct light_ray ray = {.prepared = prepared, .start = prepared->model.march.surface_offset};
    for (int i = 0; i < 3; i++) {
        ray.o[i] = dd_from_quad(mid_q(hit->point[i]));
        ray.d[i] = dd_sub(dd_from(view->light_position[i]), ray.o[i]);
    }
    struct dd distance = dd_norm(ray.d);
    ray.distance = distance.hi;
    for (int i = 0; i < 3; i++)
        ray.d[i] = dd_div(ray.d[i], distance);
    for (int kind = 0; kind < SHADOW_KINDS; kind++)
        factor[kind] = 1;
    if (prepared->model.shadows == SHADOWS_HARD) {
        enum status status = hard_shadow(&ray, hit, view, &factor[SHADOW_ESTIMATE]);
        factor[SHADOW_IDEAL] = factor[SHADOW_ESTIMATE];
        return status;
    }
    if (prepared->model.shadows == SHADOWS_SOFT || prepared->model.shadows == SHADOWS_IDEAL) {
        bool estimate = prepared->model.shadows == SHADOWS_SOFT;
        factor[SHADOW_IDEAL] = ideal_shadow(&ray);
        factor[SHADOW_ESTIMATE] = estimate ? estimated_shadow(&ray) : factor[SHADOW_IDEAL];
    }
    return PROVED;
}
