// The spans of a ray inside of a torus: roots of a quartic, isolated by signs over intervals (R. E. Moore, "Interval
// Analysis", 1966, chapter 6), then by interval Newton. Included by ray_spans.c, once in doubles and once in quads.

struct FN(quartic) {
    struct IV f[5]; // G² − H, by rising powers of s
    struct IV g[3]; // G = ρ² + y² + R² − r²: below 0 the inside of a spindle torus
    long *evals;
};

struct FN(root) {
    struct IV s;
    bool fuzzy; // not proved to be one single root
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

// Refines x, where the polynomial is monotone and changes its sign: x holds one root.
static struct IV FN(refine_root)(const struct FN(quartic) * q, struct IV x, int sign_low) {
    for (int i = 0; i < 200; i++) {
        REAL m = FN(mid)(x), width = x.hi - x.lo;
        if (!(m > x.lo && m < x.hi))
            break;
        struct IV c[5];
        FN(taylor_shift)(q, m, c);
        struct IV slope = FN(slope_range)(c, FN(half_width)(x.lo, x.hi, m));
        struct IV next = FN(sub)((struct IV){m, m}, FN(div)(c[0], slope));
        if (next.lo < x.lo || !(next.lo <= x.hi))
            next.lo = x.lo;
        if (next.hi > x.hi || !(next.hi >= x.lo))
            next.hi = x.hi;
        if (next.hi - next.lo > width * (REAL)0.5) { // halve it
            int sign = FN(sign)(c[0]);
            if (sign == 0)
                return next;
            if (sign == sign_low)
                next.lo = next.lo > m ? next.lo : m;
            else
                next.hi = next.hi < m ? next.hi : m;
        }
        if (!(next.hi - next.lo < width))
            break;
        x = next;
    }
    return x;
}

static bool FN(add_root)(struct FN(root) events[MAX_ROOTS], int *count, struct IV s, bool fuzzy) {
    struct FN(root) *last = events + *count - 1;
    if (*count > 0 && last->s.hi >= s.lo) { // the intervals touch: one, without proof
        last->s = FN(hull)(last->s, s);
        last->fuzzy = true;
        return true;
    }
    if (*count == MAX_ROOTS)
        return false;
    events[(*count)++] = (struct FN(root)){s, fuzzy};
    return true;
}

// Finds all intervals in [low, high] where the polynomial may be 0, in order. Returns false if they are too many.
static bool FN(isolate_roots)(const struct FN(quartic) * q, REAL low, REAL high, REAL scale,
                              struct FN(root) events[MAX_ROOTS], int *count) {
    struct IV stack[160];
    int depth = 0;
    stack[depth++] = (struct IV){low, high};
    for (int rounds = 0; depth > 0; rounds++) {
        if (rounds > MAX_ROUNDS)
            return false;
        struct IV x = stack[--depth];
        REAL m = x.lo + (x.hi - x.lo) * (REAL)0.484375, h = FN(half_width)(x.lo, x.hi, m);
        struct IV c[5];
        FN(taylor_shift)(q, m, c);
        struct IV value = FN(value_range)(c, h);
        if (!FN(has_zero)(value))
            continue;
        if (!FN(has_zero)(FN(slope_range)(c, h))) {
            int p = FN(sign_at)(q, x.lo), r = FN(sign_at)(q, x.hi);
            if (p * r > 0)
                continue;
            if (p * r < 0) {
                if (!FN(add_root)(events, count, FN(refine_root)(q, x, p), false))
                    return false;
                continue;
            }
        }
        // Near a double root the value is rounding alone: smaller intervals would tell no more.
        bool drowned = value.hi - value.lo <= (c[0].hi - c[0].lo) * 4;
        if (drowned || x.hi - x.lo <= RESOLUTION * scale || depth + 2 > 160 ||
            !(m > x.lo && m < x.hi)) {
            if (!FN(add_root)(events, count, x, true))
                return false;
            continue;
        }
        stack[depth++] = (struct IV){m, x.hi};
        stack[depth++] = (struct IV){x.lo, m};
    }
    return true;
}

// Finds the spans from the roots and from the side that the ray is on between them.
static void FN(spans_between_roots)(const struct FN(quartic) * q, const struct FN(root) * events,
                                    int count, struct IV range, int side, bool open,
                                    struct FN(spans) * spans) {
    struct FN(span) span = FN(whole_ray); // a ray that starts inside is inside before
    REAL end = range.hi;
    span.in_face = span.out_face = 0;
    if (side == 0) {
        span.in = span.out = range;
        span.sure = false;
        FN(add_span)(spans, span);
        return;
    }
    for (int i = 0; i < count; i++) {
        struct IV s = events[i].s;
        struct IV gap = {s.hi, i + 1 < count ? events[i + 1].s.lo : end};
        int next = i + 1 == count && !open ? 1 : FN(side_at)(q, FN(mid)(gap));
        if (next == 0) { // nothing is known from here on
            span.in = side < 0 ? span.in : s;
            span.out = (struct IV){s.lo, end};
            span.sure = false;
            FN(add_span)(spans, span);
            return;
        }
        if (side > 0 && next < 0) {
            span.in = s;
            span.out = (struct IV){(REAL)INFINITY, (REAL)INFINITY};
            span.sure = true;
        } else if (side < 0 && next > 0) {
            span.out = s;
            FN(add_span)(spans, span);
        } else if (side > 0 && events[i].fuzzy) { // may touch
            span.in = span.out = s;
            span.sure = false;
            FN(add_span)(spans, span);
        } else if (side < 0 && events[i].fuzzy) { // may leave for a moment
            span.out = s;
            span.sure = true;
            FN(add_span)(spans, span);
            span.in = s;
            span.out = (struct IV){(REAL)INFINITY, (REAL)INFINITY};
            span.sure = false;
        }
        side = next;
    }
    if (side < 0)
        FN(add_span)(spans, span); // the ray ends inside
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
    struct FN(root) events[MAX_ROOTS];
    int count = 0;
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
    if (!FN(isolate_roots)(&q, low, high, high - low, events, &count))
        spans->overflow = true;
    else
        FN(spans_between_roots)(&q, events, count, (struct IV){low, high}, side, open, spans);
}
