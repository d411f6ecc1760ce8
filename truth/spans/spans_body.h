// The spans of a ray inside of one shape, in the shape's own frame. Included by ray_spans.c, once in doubles and once in
// quads. A shape is an intersection of half-spaces and of quadratics: each clips the span.

struct FN(spans) {
    int count;
    bool overflow; // more than MAX_SPANS: nothing is known
    struct FN(span) at[MAX_SPANS];
};

static const struct FN(span) FN(whole_ray) = {
    .in = {-(REAL)INFINITY, -(REAL)INFINITY},
    .out = {(REAL)INFINITY, (REAL)INFINITY},
    .in_face = FACE_NONE,
    .out_face = FACE_NONE,
    .sure = true,
    .in_face_sure = true,
    .out_face_sure = true,
};

// Lets the span begin at s, on that face, if it begins earlier.
static void FN(clip_start)(struct FN(span) * span, struct IV s, int face) {
    if (s.hi < span->in.lo)
        return;
    bool after = s.lo > span->in.hi;
    span->in_face_sure = after || (span->in_face_sure && span->in_face == face);
    if (after || FN(mid)(s) > FN(mid)(span->in))
        span->in_face = face;
    span->in = FN(later)(span->in, s);
}

// Lets the span end at s, on that face, if it ends later.
static void FN(clip_end)(struct FN(span) * span, struct IV s, int face) {
    if (s.lo > span->out.hi)
        return;
    bool before = s.hi < span->out.lo;
    span->out_face_sure = before || (span->out_face_sure && span->out_face == face);
    if (before || FN(mid)(s) < FN(mid)(span->out))
        span->out_face = face;
    span->out = FN(sooner)(span->out, s);
}

// Clips the span to a + b·s ≤ 0. Returns false if nothing is left. range: the s that matter to the caller.
static bool FN(clip)(struct FN(span) * span, struct IV a, struct IV b, struct IV range, int face) {
    int slope = FN(sign)(b);
    if (slope > 0)
        FN(clip_end)(span, FN(neg)(FN(div)(a, b)), face);
    else if (slope < 0)
        FN(clip_start)(span, FN(neg)(FN(div)(a, b)), face);
    else { // along the face, or not certain
        struct IV value = FN(add)(a, FN(mul)(b, range));
        if (value.lo > 0)
            return false;
        span->sure = span->sure && value.hi < 0;
    }
    return span->in.lo <= span->out.hi;
}

// Adds a span to the list, unless it is surely empty.
static void FN(add_span)(struct FN(spans) * spans, struct FN(span) span) {
    if (span.in.lo > span.out.hi)
        return;
    span.sure = span.sure && span.in.hi < span.out.lo;
    if (spans->count == MAX_SPANS)
        spans->overflow = true;
    else
        spans->at[spans->count++] = span;
}

// Clips the span to a s² + 2b s + c ≤ 0 for a > 0; disc: b² − ac.
static bool FN(clip_quadratic)(struct FN(span) * span, struct IV a, struct IV b, struct IV disc,
                               int face) {
    if (disc.hi < 0)
        return false;
    span->sure = span->sure && disc.lo > 0;
    struct IV root = FN(sqrt)(disc), minus_b = FN(neg)(b);
    FN(clip_start)(span, FN(div)(FN(sub)(minus_b, root), a), face);
    FN(clip_end)(span, FN(div)(FN(add)(minus_b, root), a), face);
    return span->in.lo <= span->out.hi;
}

// Returns |o × d|², which does not cancel as o²d² − (o·d)² does.
static struct IV FN(cross_norm_sq)(const struct IV o[3], const struct IV d[3]) {
    struct IV cross[3];
    for (int i = 0, j = 1, k = 2; i < 3; i++, j = (j + 1) % 3, k = (k + 1) % 3)
        cross[i] = FN(sub)(FN(mul)(o[j], d[k]), FN(mul)(o[k], d[j]));
    return FN(norm_sq)(cross);
}

static void FN(sphere_spans)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                             struct FN(spans) * spans) {
    (void)range;
    struct FN(span) span = FN(whole_ray);
    struct IV a = FN(norm_sq)(ray->d), b = FN(dot)(ray->o, ray->d);
    struct IV radius = FN(point)(shape->sphere.radius);
    struct IV disc = FN(sub)(FN(mul)(a, FN(square)(radius)), FN(cross_norm_sq)(ray->o, ray->d));
    if (FN(clip_quadratic)(&span, a, b, disc, 0))
        FN(add_span)(spans, span);
}

static void FN(plane_spans)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                            struct FN(spans) * spans) {
    struct FN(span) span = FN(whole_ray);
    struct IV normal[3];
    for (int i = 0; i < 3; i++)
        normal[i] = FN(point)(shape->plane.normal[i]);
    struct IV a = FN(sub)(FN(dot)(normal, ray->o), FN(point)(shape->plane.offset));
    if (FN(clip)(&span, a, FN(dot)(normal, ray->d), range, 0))
        FN(add_span)(spans, span);
}

static void FN(box_spans)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                          struct FN(spans) * spans) {
    struct FN(span) span = FN(whole_ray);
    for (int i = 0; i < 3; i++) {
        struct IV half = FN(point)(shape->box.half_size[i]), o = ray->o[i], d = ray->d[i];
        if (!FN(clip)(&span, FN(sub)(o, half), d, range, 2 * i + 1) ||
            !FN(clip)(&span, FN(sub)(FN(neg)(o), half), FN(neg)(d), range, 2 * i))
            return;
    }
    FN(add_span)(spans, span);
}

static void FN(octahedron_spans)(const struct shape *shape, const struct FN(ray) * ray,
                                 struct IV range, struct FN(spans) * spans) {
    struct FN(span) span = FN(whole_ray);
    struct IV radius = FN(point)(shape->octahedron.radius);
    for (int face = 0; face < 8; face++) {
        struct IV a = FN(neg)(radius), b = {0, 0};
        for (int i = 0; i < 3; i++) {
            bool up = face >> i & 1;
            a = FN(add)(a, up ? ray->o[i] : FN(neg)(ray->o[i]));
            b = FN(add)(b, up ? ray->d[i] : FN(neg)(ray->d[i]));
        }
        if (!FN(clip)(&span, a, b, range, face))
            return;
    }
    FN(add_span)(spans, span);
}

// Returns the root of a s² + 2b s + c in x, where it changes its sign once, by interval Newton.
static struct IV FN(quadratic_root)(struct IV a, struct IV b, struct IV c, struct IV x) {
    for (int i = 0; i < 100; i++) {
        REAL m = FN(mid)(x);
        struct IV at = {m, m};
        struct IV value = FN(add)(FN(mul)(FN(add)(FN(mul)(a, at), FN(add)(b, b)), at), c);
        struct IV slope = FN(add)(FN(mul)(a, x), b);
        slope = FN(add)(slope, slope);
        if (FN(has_zero)(slope))
            return x;
        struct IV next = FN(sub)(at, FN(div)(value, slope));
        next.lo = next.lo > x.lo ? next.lo : x.lo;
        next.hi = next.hi < x.hi ? next.hi : x.hi;
        if (!(next.lo <= next.hi) || next.hi - next.lo > (x.hi - x.lo) * (REAL)0.9)
            return x;
        x = next;
    }
    return x;
}

// Clips the span to a cone's side where the coefficient a may be 0: by the signs at the two caps.
static bool FN(clip_by_signs)(struct FN(span) * span, struct IV a, struct IV b, struct IV c) {
    struct IV x = span->in, y = span->out;
    if (!(x.lo > -(REAL)INFINITY) || !(y.hi < (REAL)INFINITY)) {
        span->sure = false;
        return true;
    }
    struct IV two_b = FN(add)(b, b);
    struct IV at_in = FN(add)(FN(mul)(FN(add)(FN(mul)(a, x), two_b), x), c);
    struct IV at_out = FN(add)(FN(mul)(FN(add)(FN(mul)(a, y), two_b), y), c);
    int p = FN(sign)(at_in), q = FN(sign)(at_out);
    struct IV between = {x.lo, y.hi};
    if (p < 0 && q < 0)
        return true;
    if (p < 0 && q > 0) {
        span->out = FN(quadratic_root)(a, b, c, between);
        span->out_face = FACE_SIDE;
        span->out_face_sure = true;
    } else if (p > 0 && q < 0) {
        span->in = FN(quadratic_root)(a, b, c, between);
        span->in_face = FACE_SIDE;
        span->in_face_sure = true;
    } else if (p > 0 && q > 0) { // the parabola is below its chord by at most |a|·length²/4
        struct IV length = FN(sub)(y, x);
        struct IV sag =
            FN(scale)(FN(mul)((struct IV){0, FN(magnitude)(a)}, FN(square)(length)), 0.25);
        REAL least = at_in.lo < at_out.lo ? at_in.lo : at_out.lo;
        if (least > sag.hi)
            return false;
        span->sure = false;
    } else
        span->sure = false;
    return true;
}

// Between the caps, and ρ ≤ r(y) = middle + slope·y: one half of a double cone.
static void FN(cone_spans)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                           struct FN(spans) * spans) {
    struct FN(span) span = FN(whole_ray);
    const struct IV *o = ray->o, *d = ray->d;
    struct IV half = FN(point)(shape->cone.half_height);
    struct IV r1 = FN(point)(shape->cone.bottom_radius), r2 = FN(point)(shape->cone.top_radius);
    if (!FN(clip)(&span, FN(sub)(o[1], half), d[1], range, FACE_TOP) ||
        !FN(clip)(&span, FN(sub)(FN(neg)(o[1]), half), FN(neg)(d[1]), range, FACE_BOTTOM))
        return;
    struct IV slope = FN(div)(FN(sub)(r2, r1), FN(add)(half, half));
    struct IV here = FN(add)(FN(scale)(FN(add)(r1, r2), 0.5), FN(mul)(slope, o[1]));
    struct IV growth = FN(mul)(slope, d[1]);
    struct IV a = FN(sub)(FN(add)(FN(square)(d[0]), FN(square)(d[2])), FN(square)(growth));
    struct IV b = FN(sub)(FN(add)(FN(mul)(o[0], d[0]), FN(mul)(o[2], d[2])), FN(mul)(here, growth));
    struct IV c = FN(sub)(FN(add)(FN(square)(o[0]), FN(square)(o[2])), FN(square)(here));
    struct IV disc = FN(sub)(FN(square)(b), FN(mul)(a, c));
    int bend = FN(sign)(a);
    bool left = true;
    if (bend > 0)
        left = FN(clip_quadratic)(&span, a, b, disc, FACE_SIDE);
    else if (bend < 0 && FN(sign)(growth) != 0 && disc.lo > 0) {
        // Inside beyond the roots; for a < 0 they stand in the other order.
        struct IV root = FN(sqrt)(disc), minus_b = FN(neg)(b);
        if (growth.lo > 0)
            FN(clip_start)(&span, FN(div)(FN(sub)(minus_b, root), a), FACE_SIDE);
        else
            FN(clip_end)(&span, FN(div)(FN(add)(minus_b, root), a), FACE_SIDE);
    } else
        left = FN(clip_by_signs)(&span, a, b, c);
    if (left)
        FN(add_span)(spans, span);
}
