// The spans of a ray inside of a torus, between the roots of a quartic (roots_body.h). Included by ray_spans.c, once in
// doubles and once in quads.

struct FN(quartic) {
    struct IV f[5]; // G² − H, by rising powers of s
    struct IV g[3]; // G = ρ² + y² + R² − r²: below 0 the inside of a spindle torus
    long *evals;
};

// Computes the coefficients about m.
static void FN(taylor_shift)(const struct FN(quartic) * q, REAL m, struct IV out[5]) {
    struct IV at = {m, m};
    memcpy(out, q->f, 5 * sizeof *out);
    for (int i = 0; i < 4; i++)
        for (int j = 3; j >= i; j--)
            out[j] = FN(add)(out[j], FN(mul)(out[j + 1], at));
    ++*q->evals;
}

static int FN(sign_at)(const struct FN(quartic) * q, REAL s) {
    struct IV at = {s, s}, sum = q->f[4];
    for (int i = 3; i >= 0; i--)
        sum = FN(add)(FN(mul)(sum, at), q->f[i]);
    ++*q->evals;
    return FN(sign)(sum);
}

// Returns −1 inside, 1 outside, 0 if it is not certain.
static int FN(side_at)(const struct FN(quartic) * q, REAL s) {
    struct IV at = {s, s};
    int f = FN(sign_at)(q, s);
    if (f < 0)
        return -1;
    struct IV g = FN(add)(FN(mul)(FN(add)(FN(mul)(q->g[2], at), q->g[1]), at), q->g[0]);
    int side = FN(sign)(g);
    return side < 0 ? -1 : f > 0 && side > 0 ? 1 : 0;
}

// Enclose the derivative and the polynomial over m ± h, from the coefficients about m.
static struct IV FN(slope_range)(const struct IV c[5], REAL h) {
    struct IV u = {-h, h}, sum = FN(scale)(c[4], 4);
    sum = FN(add)(FN(mul)(sum, u), FN(scale)(c[3], 3));
    sum = FN(add)(FN(mul)(sum, u), FN(scale)(c[2], 2));
    return FN(add)(FN(mul)(sum, u), c[1]);
}

static struct IV FN(value_range)(const struct IV c[5], REAL h) {
    struct IV u = {-h, h}, sum = FN(mul)(c[4], u);
    sum = FN(mul)(FN(add)(sum, c[3]), u);
    sum = FN(mul)(FN(add)(sum, c[2]), u);
    sum = FN(mul)(FN(add)(sum, c[1]), u);
    return FN(add)(sum, c[0]);
}

static REAL FN(half_width)(REAL low, REAL high, REAL m) {
    REAL below = m - low, above = high - m;
    return FN(above)(below > above ? below : above);
}

// The curve's functions, see roots_body.h.
static struct FN(jet) FN(quartic_over)(void *of, REAL lo, REAL m, REAL hi) {
    struct FN(jet) jet = {.rough = false};
    struct IV c[5];
    REAL h = FN(half_width)(lo, hi, m);
    FN(taylor_shift)(of, m, c);
    jet.at = c[0];
    jet.over = FN(value_range)(c, h);
    jet.slope = FN(slope_range)(c, h);
    return jet;
}

static int FN(quartic_sign)(void *of, REAL s) {
    return FN(sign_at)(of, s);
}

static int FN(quartic_side)(void *of, REAL s) {
    return FN(side_at)(of, s);
}

static void FN(torus_spans)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                            struct FN(spans) * spans, long *evals) {
    const struct IV *o = ray->o, *d = ray->d;
    struct IV big = FN(point)(shape->torus.major_radius);
    struct IV small = FN(point)(shape->torus.minor_radius);
    struct IV a = FN(norm_sq)(d), b = FN(dot)(o, d), c = FN(norm_sq)(o);
    // The torus lies in the ball of radius R + r.
    struct FN(span) ball = FN(whole_ray);
    struct IV disc = FN(sub)(FN(mul)(a, FN(square)(FN(add)(big, small))), FN(cross_norm_sq)(o, d));
    if (!FN(clip_quadratic)(&ball, a, b, disc, 0))
        return;
    struct IV four = FN(scale)(FN(square)(big), 4);
    struct IV k = FN(add)(c, FN(mul)(FN(sub)(big, small), FN(add)(big, small)));
    struct IV h0 = FN(add)(FN(square)(o[0]), FN(square)(o[2]));
    struct IV h1 = FN(add)(FN(mul)(o[0], d[0]), FN(mul)(o[2], d[2]));
    struct IV h2 = FN(add)(FN(square)(d[0]), FN(square)(d[2]));
    struct FN(quartic) q = {.evals = evals};
    q.g[0] = k;
    q.g[1] = FN(add)(b, b);
    q.g[2] = a;
    q.f[0] = FN(sub)(FN(square)(k), FN(mul)(four, h0));
    q.f[1] = FN(sub)(FN(scale)(FN(mul)(b, k), 4), FN(scale)(FN(mul)(four, h1), 2));
    q.f[2] = FN(sub)(FN(add)(FN(scale)(FN(square)(b), 4), FN(scale)(FN(mul)(a, k), 2)),
                     FN(mul)(four, h2));
    q.f[3] = FN(scale)(FN(mul)(a, b), 4);
    q.f[4] = FN(square)(a);
    struct FN(curve) curve = {&q, FN(quartic_over), FN(quartic_sign), FN(quartic_side)};
    // A hair more than the ball, so that both ends are outside of the torus. The margin is relative to the ball: a
    // ray along the outer equator has no length inside of it.
    struct IV across = FN(sqrt)(FN(div)(FN(square)(FN(add)(big, small)), a));
    REAL room = ((ball.out.hi - ball.in.lo) + across.hi) * (REAL)0x1p-20;
    REAL low = ball.in.lo - room, high = ball.out.hi + room;
    // Not beyond the range, where the ray may begin or end inside.
    int side = 1;
    if (low < range.lo) {
        low = range.lo;
        side = FN(side_at)(&q, low);
    }
    bool open = range.hi < high;
    high = open ? range.hi : high;
    if (!(low < high))
        return;
    FN(spans_of_curve)(&curve, (struct IV){low, high}, side, open, false, spans);
}
