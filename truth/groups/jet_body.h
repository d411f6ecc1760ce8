// Arithmetic of functions with derivatives (R. E. Moore, "Methods and Applications of Interval Analysis", SIAM 1979:
// automatic differentiation and the mean value form). Included by field.c, once in doubles and once in quads.
// away: [lo − m, hi − m] of the interval.

static struct FN(jet) FN(number)(double x) {
    return (struct FN(jet)){.at = {x, x}, .over = {x, x}};
}

// Narrows the values by the mean value form.
static struct FN(jet) FN(tight)(struct FN(jet) a, struct IV away) {
    if (a.rough)
        return a;
    struct IV mean = FN(add)(a.at, FN(mul)(a.slope, away));
    if (mean.lo > a.over.lo)
        a.over.lo = mean.lo;
    if (mean.hi < a.over.hi)
        a.over.hi = mean.hi;
    return a;
}

static struct FN(jet) FN(neg_jet)(struct FN(jet) a) {
    return (struct FN(jet)){FN(neg)(a.at), FN(neg)(a.over), FN(neg)(a.slope), a.rough};
}

static struct FN(jet) FN(plus)(struct FN(jet) a, struct FN(jet) b) {
    return (struct FN(jet)){FN(add)(a.at, b.at), FN(add)(a.over, b.over), FN(add)(a.slope, b.slope),
                            a.rough || b.rough};
}

static struct FN(jet) FN(minus)(struct FN(jet) a, struct FN(jet) b) {
    return FN(plus)(a, FN(neg_jet)(b));
}

static struct FN(jet) FN(less)(struct FN(jet) a, double x) {
    a.at = FN(sub)(a.at, FN(point)(x));
    a.over = FN(sub)(a.over, FN(point)(x));
    return a;
}

static struct FN(jet) FN(times)(struct FN(jet) a, struct IV x) {
    return (struct FN(jet)){FN(mul)(a.at, x), FN(mul)(a.over, x), FN(mul)(a.slope, x), a.rough};
}

static struct FN(jet) FN(product)(struct FN(jet) a, struct FN(jet) b, struct IV away) {
    struct FN(jet) c = {.at = FN(mul)(a.at, b.at),
                        .over = FN(mul)(a.over, b.over),
                        .slope = FN(add)(FN(mul)(a.slope, b.over), FN(mul)(a.over, b.slope)),
                        .rough = a.rough || b.rough};
    return FN(tight)(c, away);
}

// x/a for a > 0.
static struct FN(jet) FN(inverse)(double x, struct FN(jet) a, struct IV away) {
    struct IV top = FN(point)(x);
    struct FN(jet) c = {.at = FN(div)(top, a.at), .over = FN(div)(top, a.over), .rough = a.rough};
    c.slope = FN(neg)(FN(div)(FN(mul)(c.over, a.slope), a.over));
    return FN(tight)(c, away);
}

// a where `side` ≤ 0, b where it is > 0: they meet where it is 0.
static struct FN(jet) FN(pick)(struct FN(jet) side, struct FN(jet) a, struct FN(jet) b) {
    if (side.over.hi <= 0)
        return a;
    if (side.over.lo > 0)
        return b;
    struct IV at = side.at.hi <= 0 ? a.at : side.at.lo > 0 ? b.at : FN(hull)(a.at, b.at);
    return (struct FN(jet)){at, FN(hull)(a.over, b.over), FN(hull)(a.slope, b.slope),
                            a.rough || b.rough || side.rough};
}

static struct FN(jet) FN(least)(struct FN(jet) a, struct FN(jet) b) {
    if (a.over.hi < b.over.lo)
        return a;
    if (b.over.hi < a.over.lo)
        return b;
    return (struct FN(jet)){FN(sooner)(a.at, b.at), FN(sooner)(a.over, b.over),
                            FN(hull)(a.slope, b.slope), a.rough || b.rough};
}

static struct FN(jet) FN(most)(struct FN(jet) a, struct FN(jet) b) {
    return FN(neg_jet)(FN(least)(FN(neg_jet)(a), FN(neg_jet)(b)));
}

static struct FN(jet) FN(size)(struct FN(jet) a) {
    return FN(most)(a, FN(neg_jet)(a));
}

// √(Σ aᵢ²). Its slope is at most √(Σ aᵢ'²), which holds where it is 0, too.
static struct FN(jet) FN(norm)(int count, const struct FN(jet) * a, struct IV away) {
    struct IV at = {0, 0}, over = at, dot = at, steep = at;
    struct FN(jet) c = {.rough = false};
    for (int i = 0; i < count; i++) {
        at = FN(add)(at, FN(square)(a[i].at));
        over = FN(add)(over, FN(square)(a[i].over));
        dot = FN(add)(dot, FN(mul)(a[i].over, a[i].slope));
        steep = FN(add)(steep, FN(square)(a[i].slope));
        c.rough = c.rough || a[i].rough;
    }
    REAL most = FN(sqrt)(steep).hi;
    c.at = FN(sqrt)(at);
    c.over = FN(sqrt)(over);
    c.slope = (struct IV){-most, most};
    if (c.over.lo > 0) {
        struct IV slope = FN(div)(dot, c.over);
        c.slope.lo = slope.lo > -most ? slope.lo : -most;
        c.slope.hi = slope.hi < most ? slope.hi : most;
    }
    return FN(tight)(c, away);
}

static struct FN(jet) FN(norm_2)(struct FN(jet) a, struct FN(jet) b, struct IV away) {
    return FN(norm)(2, (struct FN(jet)[2]){a, b}, away);
}

static void FN(waves)(struct FN(jet) a, struct IV away, struct FN(jet) * sine,
                      struct FN(jet) * cosine) {
    struct FN(jet) s = {.at = FN(sine)(a.at, 0), .over = FN(sine)(a.over, 0), .rough = a.rough};
    struct FN(jet) c = {.at = FN(sine)(a.at, 1), .over = FN(sine)(a.over, 1), .rough = a.rough};
    s.slope = FN(mul)(c.over, a.slope);
    c.slope = FN(neg)(FN(mul)(s.over, a.slope));
    *sine = FN(tight)(s, away);
    *cosine = FN(tight)(c, away);
}
