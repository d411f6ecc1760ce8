// opt11_ideal's widest cones about rays (shadow/widest_cone.h, widest_torus.h) against the least ratio in double: of
// convex solids by ternary search in u = 1/t (u·h(1/u) is convex), of a torus by branch and bound (h falls no faster than
// t grows). STEPWISE_RAYS: rays of each solid.
#include "tests/c/testing.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "random_from.h"
#include "shadow/own_solid.h"
#include "shadow/widest_torus.h"

#define STRENGTH 3.0
enum { FEW_RAYS = 8000, DEEPEST = 200, SAMPLES = 400 };

static double clamp_to(double a, double low, double high) {
    return a < low ? low : a > high ? high : a;
}

static double box_distance(const double p[3], const struct primitive *s, double rounding) {
    double square = 0, most = -INFINITY;
    for (int k = 0; k < 3; k++) {
        double over = fabs(p[k]) - (double)s->size[k];
        square += over > 0 ? over * over : 0;
        most = fmax(most, over);
    }
    return sqrt(square) + fmin(most, 0) - rounding;
}

static double cone_distance(const double p[3], const struct primitive *s) {
    double a = s->a, b = s->b, c = s->c, radius = hypot(p[0], p[2]);
    double x = radius - b, y = p[1] - c, dx = (double)s->slope[0], dy = (double)s->slope[1];
    double share = clamp_to(-(x * dx + y * dy) / (dx * dx + dy * dy), 0, 1);
    double side_x = x + share * dx, side_y = y + share * dy;
    double cap_x = fmax(radius - (p[1] < 0 ? a : b), 0), cap_y = fabs(p[1]) - c;
    double least = fmin(hypot(cap_x, cap_y), hypot(side_x, side_y));
    return side_x < 0 && cap_y < 0 ? -least : least;
}

static double octahedron_distance(const double at[3], double radius) {
    double p[3] = {fabs(at[0]), fabs(at[1]), fabs(at[2])}, m = p[0] + p[1] + p[2] - radius;
    double face = m / sqrt(3), least = INFINITY;
    if (fmin(p[0], fmin(p[1], p[2])) >= m / 3)
        return face;
    for (int k = 0; k < 3; k++) { // the edges that bound this octant
        double u = p[(k + 1) % 3], v = p[(k + 2) % 3],
               on = clamp_to((u - v + radius) / 2, 0, radius);
        least = fmin(
            least, sqrt(p[k] * p[k] + (u - on) * (u - on) + (v - radius + on) * (v - radius + on)));
    }
    return least;
}

struct ray {
    double o[3], d[3], near, far;
};

static double height_at(const struct ray *r, const struct primitive *s, double t) {
    double p[3];
    for (int k = 0; k < 3; k++)
        p[k] = r->o[k] + t * r->d[k];
    switch (s->type) {
    case SHAPE_SPHERE: return sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - (double)s->a;
    case SHAPE_BOX: return box_distance(p, s, 0);
    case SHAPE_ROUNDED_BOX: return box_distance(p, s, (double)s->a);
    case SHAPE_CONE: return cone_distance(p, s);
    case SHAPE_OCTAHEDRON: return octahedron_distance(p, (double)s->a);
    default: return hypot(hypot(p[0], p[2]) - (double)s->a, p[1]) - (double)s->b;
    }
}

static double least_of_convex(const struct ray *r, const struct primitive *s) {
    double low = 1 / r->far, high = 1 / r->near;
    for (int i = 0; i < 160; i++) {
        double a = low + (high - low) / 3, b = high - (high - low) / 3;
        if (a * height_at(r, s, 1 / a) < b * height_at(r, s, 1 / b))
            high = b;
        else
            low = a;
    }
    double u = (low + high) / 2;
    return fmin(u * height_at(r, s, 1 / u),
                fmin(height_at(r, s, r->far) / r->far, height_at(r, s, r->near) / r->near));
}

// The least ratio found by sampling, each low place refined, and then proved to 1e-5 by the bound: a smaller one is a
// new place to refine.
static double refined(const struct ray *r, const struct primitive *s, double low, double high) {
    for (int i = 0; i < 80; i++) {
        double a = low + (high - low) / 3, b = high - (high - low) / 3;
        if (a * height_at(r, s, 1 / a) < b * height_at(r, s, 1 / b))
            high = b;
        else
            low = a;
    }
    return high * height_at(r, s, 1 / high);
}

static double least_of_torus(const struct ray *r, const struct primitive *s) {
    double low = 1 / r->far, high = 1 / r->near,
           best = fmin(1 / STRENGTH, low * height_at(r, s, r->far));
    best = fmin(best, high * height_at(r, s, r->near));
    double before = INFINITY, here = INFINITY, u = low, grown = pow(high / low, 1.0 / SAMPLES);
    for (int i = 0; i <= SAMPLES; i++, u *= grown) {
        double value = u * height_at(r, s, 1 / u);
        if (here <= before && here <= value && here < best + 0.02)
            best = fmin(best, refined(r, s, fmax(u / grown / grown, low), fmin(u, high)));
        before = here;
        here = value;
    }
    double stack[DEEPEST][2] = {{r->near, r->far}};
    for (int count = 1; count > 0 && best > 0;) {
        double a = stack[count - 1][0], b = stack[--count][1], m = (a + b) / 2;
        double h = height_at(r, s, m);
        if (h / m < best)
            best = fmin(h / m, refined(r, s, 1 / b, 1 / a));
        if ((h - (b - a) / 2) / b >= best - 1e-5 && h > (b - a) / 2)
            continue;
        assert_true(count + 2 <= DEEPEST && m > a && m < b);
        stack[count][0] = m;
        stack[count++][1] = b;
        stack[count][0] = a;
        stack[count++][1] = m;
    }
    return fmax(best, 0);
}

// A ray from around the solid, now and then from close to it, towards a place in or beside it; the light is beyond the
// solid, before it or in it.
static struct ray random_ray(const struct primitive *s) {
    double size = s->bound, square = 0;
    // In shares of a large solid: a float knows a place to 6e-8 of its size.
    struct ray r = {.near = (double)(float)(fmax(1, size) * pow(10, random_from(-3, -1.5)))};
    double reach = size * pow(10, random_from(-0.3, 1)), to[3];
    for (int k = 0; k < 3; k++) {
        r.o[k] = (double)(float)(reach * random_from(-1, 1));
        to[k] = size * random_from(-1.3, 1.3);
        if (random_from(0, 1) < 0.05) // in line with an axis or a face
            to[k] = r.o[k];
        r.d[k] = to[k] - r.o[k];
        square += r.d[k] * r.d[k];
    }
    for (int k = 0; k < 3; k++)
        r.d[k] = square > 0 ? (double)(float)(r.d[k] / sqrt(square)) : k == 0;
    double far = random_from(0, 1) < 0.3 ? random_from(0, 2) * sqrt(square) : 100;
    r.far = (double)(float)fmax(far, 1.01 * r.near);
    return r;
}

static struct cone_rays rays_of(const struct ray *r) {
    float field[8][LANES];
    for (int lane = 0; lane < LANES; lane++) {
        for (int k = 0; k < 3; k++) {
            field[k][lane] = (float)r[lane].o[k];
            field[k + 3][lane] = (float)r[lane].d[k];
        }
        field[6][lane] = (float)r[lane].near;
        field[7][lane] = (float)r[lane].far;
    }
    return (struct cone_rays){{v_load(field[0]), v_load(field[1]), v_load(field[2])},
                              {v_load(field[3]), v_load(field[4]), v_load(field[5])},
                              v_load(field[6]),
                              v_load(field[7])};
}

static vfloat widest(const struct cone_rays *r, const struct primitive *s) {
    vfloat best = v_splat((float)(1 / STRENGTH)), where;
    vfloat room = v_splat(room_for((float)STRENGTH));
    if (s->type == SHAPE_SPHERE)
        return widest_sphere(r, s, best, v_mask_all());
    if (s->type == SHAPE_TORUS)
        return widest_torus(r, s, best, v_mask_all(), room);
    return widest_convex(r, s, best, v_mask_all(), room, &where);
}

// Errors of the shadow, 0 to 1, over all rays of a kind of solid.
struct errors {
    double most, squares, penumbra;
    struct ray worst;
    struct primitive of;
    long rays;
};

static void note(double found, double exact, const struct ray *r, const struct primitive *s,
                 struct errors *all) {
    exact = clamp_to(STRENGTH * exact, 0, 1);
    double error = fabs(clamp_to(STRENGTH * found, 0, 1) - exact);
    all->penumbra += exact > 0 && exact < 1;
    all->squares += error * error;
    all->rays++;
    if (error <= all->most)
        return;
    all->most = error;
    all->worst = *r;
    all->of = *s;
}

static void judge(const char *name, const struct errors *all, double most) {
    const struct ray *r = &all->worst;
    const struct primitive *s = &all->of;
    double rms = sqrt(all->squares / (double)all->rays);
    printf("%s: %ld rays, %.0f %% penumbra: largest error %.2e, RMS %.2e\n", name, all->rays,
           100 * all->penumbra / (double)all->rays, all->most, rms);
    printf("  o %.9g %.9g %.9g d %.9g %.9g %.9g near %g far %g; a %g b %g c %g size %g %g %g\n",
           r->o[0], r->o[1], r->o[2], r->d[0], r->d[1], r->d[2], r->near, r->far, (double)s->a,
           (double)s->b, (double)s->c, (double)s->size[0], (double)s->size[1], (double)s->size[2]);
    assert_true(all->most <= most);
    assert_true(rms <= 2e-6);
}

static long rays_asked(void) {
    const char *asked = getenv("STEPWISE_RAYS");
    return asked ? atol(asked) : FEW_RAYS;
}

static void measure(const struct primitive *s, struct errors *all) {
    struct ray rays[LANES];
    for (int lane = 0; lane < LANES; lane++)
        rays[lane] = random_ray(s);
    struct cone_rays packet = rays_of(rays);
    float found[LANES];
    v_store(widest(&packet, s), found);
    for (int lane = 0; lane < LANES; lane++) {
        const struct ray *r = &rays[lane];
        double exact = s->type == SHAPE_TORUS ? least_of_torus(r, s) : least_of_convex(r, s);
        note((double)found[lane], exact, r, s, all);
    }
}

static struct primitive random_solid(enum shape_type type) {
    struct primitive s = {.type = type, .eval = EVAL_POINT, .convex = type != SHAPE_TORUS};
    double a = pow(10, random_from(-1, 0.5)), b = a * pow(10, random_from(-1.5, 0.3)),
           c = a * pow(10, random_from(-1.5, 1));
    if (type == SHAPE_BOX || type == SHAPE_ROUNDED_BOX) {
        double half[3] = {a, b, c}, rounding = type == SHAPE_BOX ? 0 : a * random_from(0.05, 1);
        for (int k = 0; k < 3; k++)
            s.size[k] = (float)half[k];
        s.a = (float)rounding;
        s.bound = (float)((sqrt(a * a + b * b + c * c) + rounding) * (1 + 1e-5));
    } else if (type == SHAPE_CONE) {
        double kind = random_from(0, 1), top = kind < 0.2 ? 0 : kind < 0.4 ? a : b;
        s.a = (float)a;
        s.b = (float)top;
        s.c = (float)c;
        double across = (double)s.b - (double)s.a, up = 2 * (double)s.c;
        s.slope[0] = (float)across;
        s.slope[1] = (float)up;
        s.per_slope_sq = (float)(1 / (across * across + up * up));
        s.bound = (float)(hypot(fmax(a, top), c) * (1 + 1e-5));
    } else {
        s.a = (float)a;
        s.b = (float)fmin(b, 0.95 * a);
        s.bound = type == SHAPE_TORUS ? (float)((a + (double)s.b) * (1 + 1e-5)) : s.a;
        if (type == SHAPE_OCTAHEDRON)
            s.bound = (float)(a * (1 + 1e-5));
    }
    s.bound_sq = s.bound * s.bound;
    return s;
}

static void cones_are_the_widest(enum shape_type type, const char *name) {
    struct errors all = {0};
    while (all.rays < rays_asked()) {
        struct primitive s = random_solid(type);
        for (int i = 0; i < 4; i++)
            measure(&s, &all);
    }
    judge(name, &all, 1e-4);
}

// Sets p to where a ray from outside enters the solid, in double. Returns false if it misses.
static bool enters(const struct primitive *s, double p[3]) {
    struct ray r = random_ray(s);
    double t = 0;
    for (int step = 0; step < 4000 && t < 40 * (double)s->bound; step++) {
        double h = height_at(&r, s, t);
        t += h;
        if (fabs(h) < 1e-15 * (double)s->bound) {
            for (int k = 0; k < 3; k++)
                p[k] = r.o[k] + t * r.d[k];
            return step > 0;
        }
    }
    return false;
}

// Rounds the point to floats and puts it back on the surface, straight out or in.
static void snap(const struct primitive *s, double p[3]) {
    struct ray r = {.near = 0};
    double n[3], step = 1e-7 * (double)s->bound;
    for (int k = 0; k < 3; k++)
        r.o[k] = (double)(float)p[k];
    for (int k = 0; k < 3; k++) {
        r.d[k] = 1;
        n[k] = (height_at(&r, s, step) - height_at(&r, s, -step)) / (2 * step);
        r.d[k] = 0;
    }
    double h = height_at(&r, s, 0);
    for (int k = 0; k < 3; k++)
        p[k] = r.o[k] - h * n[k];
}

// Rays that start on the solid, near edges and rims too, and not into it. `near` is a thousandth of the solid's size: a
// float that is off by an ulp puts an edge 6e-5 of `near` elsewhere, 2e-4 in the shadow.
static void own_ratios_are_right(enum shape_type type, const char *name) {
    struct errors all = {0};
    while (all.rays < rays_asked()) {
        struct primitive s = random_solid(type);
        struct ray r = {.near = (double)0.001f * (double)s.bound};
        if (!enters(&s, r.o))
            continue;
        struct ray light = random_ray(&s);
        memcpy(r.d, light.d, sizeof r.d);
        struct vec p = {v_splat((float)r.o[0]), v_splat((float)r.o[1]), v_splat((float)r.o[2])};
        snap(&s, r.o);
        double exact = height_at(&r, &s, r.near) / r.near;
        if (exact <= 0)
            continue;
        struct vec d = {v_splat((float)r.d[0]), v_splat((float)r.d[1]), v_splat((float)r.d[2])};
        double found = (double)v_lane0(own_ratio(&s, p, d, v_splat((float)r.near)));
        note(found, exact, &r, &s, &all);
    }
    // On a cone's cap the distance to the rim is a difference of roots: three ulps.
    judge(name, &all, type == SHAPE_CONE ? 1e-3 : 3e-4);
}

static const struct {
    const char *name;
    enum shape_type type;
} solids[] = {
    {"sphere", SHAPE_SPHERE},         {"box", SHAPE_BOX},   {"rounded box", SHAPE_ROUNDED_BOX},
    {"octahedron", SHAPE_OCTAHEDRON}, {"cone", SHAPE_CONE}, {"torus", SHAPE_TORUS}};

TEST(test_widest_cones) {
    for (int i = 0; i < 6; i++)
        cones_are_the_widest(solids[i].type, solids[i].name);
}

TEST(test_own_solids) {
    for (int i = 0; i < 6; i++)
        own_ratios_are_right(solids[i].type, solids[i].name);
}

RUN_TESTS(NULL, NULL)
