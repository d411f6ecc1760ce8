// Parts of a ray inside of one shape, in the shape's own frame. Included by solve.c twice.

struct FN(parts) {
    int count;
    bool lost; // more than can be kept: nothing is known
    struct FN(part) at[MOST_PARTS];
};

static const struct FN(part) FN(whole) = {
    .in = {-(REAL)INFINITY, -(REAL)INFINITY},
    .out = {(REAL)INFINITY, (REAL)INFINITY},
    .in_face = FACE_NONE,
    .out_face = FACE_NONE,
    .sure = true,
    .in_face_sure = true,
    .out_face_sure = true,
};

static inline struct IV FN(later)(struct IV a, struct IV b) {
    return (struct IV){a.lo > b.lo ? a.lo : b.lo, a.hi > b.hi ? a.hi : b.hi};
}

static inline struct IV FN(sooner)(struct IV a, struct IV b) {
    return (struct IV){a.lo < b.lo ? a.lo : b.lo, a.hi < b.hi ? a.hi : b.hi};
}

static void FN(begins)(struct FN(part) * part, struct IV s, int face) {
    if (s.hi < part->in.lo)
        return;
    bool after = s.lo > part->in.hi;
    part->in_face_sure = after || (part->in_face_sure && part->in_face == face);
    if (after || FN(mid)(s) > FN(mid)(part->in))
        part->in_face = face;
    part->in = FN(later)(part->in, s);
}

static void FN(ends)(struct FN(part) * part, struct IV s, int face) {
    if (s.lo > part->out.hi)
        return;
    bool before = s.hi < part->out.lo;
    part->out_face_sure = before || (part->out_face_sure && part->out_face == face);
    if (before || FN(mid)(s) < FN(mid)(part->out))
        part->out_face = face;
    part->out = FN(sooner)(part->out, s);
}

// Clips the part to a + b·s ≤ 0. False: nothing is left. `range`: the s that matter.
static bool FN(clip)(struct FN(part) * part, struct IV a, struct IV b, struct IV range, int face) {
    int slope = FN(sign)(b);
    if (slope > 0)
        FN(ends)(part, FN(neg)(FN(div)(a, b)), face);
    else if (slope < 0)
        FN(begins)(part, FN(neg)(FN(div)(a, b)), face);
    else { // along the face, or nearly
        struct IV value = FN(add)(a, FN(mul)(b, range));
        if (value.lo > 0)
            return false;
        part->sure = part->sure && value.hi < 0;
    }
    return part->in.lo <= part->out.hi;
}

static void FN(keep)(struct FN(parts) * parts, struct FN(part) part) {
    if (part.in.lo > part.out.hi)
        return;
    part.sure = part.sure && part.in.hi < part.out.lo;
    if (parts->count == MOST_PARTS)
        parts->lost = true;
    else
        parts->at[parts->count++] = part;
}

// a s² + 2b s + c ≤ 0 with a > 0, the discriminant (b² − ac) given.
static bool FN(clip_round)(struct FN(part) * part, struct IV a, struct IV b, struct IV disc,
                           int face) {
    if (disc.hi < 0)
        return false;
    part->sure = part->sure && disc.lo > 0;
    struct IV root = FN(root)(disc), minus_b = FN(neg)(b);
    FN(begins)(part, FN(div)(FN(sub)(minus_b, root), a), face);
    FN(ends)(part, FN(div)(FN(add)(minus_b, root), a), face);
    return part->in.lo <= part->out.hi;
}

// |o × d|², without the cancellation of o²d² − (o·d)².
static struct IV FN(cross_square)(const struct IV o[3], const struct IV d[3]) {
    struct IV cross[3];
    for (int i = 0, j = 1, k = 2; i < 3; i++, j = (j + 1) % 3, k = (k + 1) % 3)
        cross[i] = FN(sub)(FN(mul)(o[j], d[k]), FN(mul)(o[k], d[j]));
    return FN(square)(cross);
}

static void FN(in_sphere)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                          struct FN(parts) * parts) {
    (void)range;
    struct FN(part) part = FN(whole);
    struct IV a = FN(square)(ray->d), b = FN(dot)(ray->o, ray->d);
    struct IV radius = FN(point)(shape->sphere.radius);
    struct IV disc = FN(sub)(FN(mul)(a, FN(sqr)(radius)), FN(cross_square)(ray->o, ray->d));
    if (FN(clip_round)(&part, a, b, disc, 0))
        FN(keep)(parts, part);
}

static void FN(in_plane)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                         struct FN(parts) * parts) {
    struct FN(part) part = FN(whole);
    struct IV normal[3];
    for (int i = 0; i < 3; i++)
        normal[i] = FN(point)(shape->plane.normal[i]);
    struct IV a = FN(sub)(FN(dot)(normal, ray->o), FN(point)(shape->plane.offset));
    if (FN(clip)(&part, a, FN(dot)(normal, ray->d), range, 0))
        FN(keep)(parts, part);
}

static void FN(in_box)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                       struct FN(parts) * parts) {
    struct FN(part) part = FN(whole);
    for (int i = 0; i < 3; i++) {
        struct IV half = FN(point)(shape->box.half_size[i]), o = ray->o[i], d = ray->d[i];
        if (!FN(clip)(&part, FN(sub)(o, half), d, range, 2 * i + 1) ||
            !FN(clip)(&part, FN(sub)(FN(neg)(o), half), FN(neg)(d), range, 2 * i))
            return;
    }
    FN(keep)(parts, part);
}

static void FN(in_octahedron)(const struct shape *shape, const struct FN(ray) * ray,
                              struct IV range, struct FN(parts) * parts) {
    struct FN(part) part = FN(whole);
    struct IV radius = FN(point)(shape->octahedron.radius);
    for (int face = 0; face < 8; face++) {
        struct IV a = FN(neg)(radius), b = {0, 0};
        for (int i = 0; i < 3; i++) {
            bool up = face >> i & 1;
            a = FN(add)(a, up ? ray->o[i] : FN(neg)(ray->o[i]));
            b = FN(add)(b, up ? ray->d[i] : FN(neg)(ray->d[i]));
        }
        if (!FN(clip)(&part, a, b, range, face))
            return;
    }
    FN(keep)(parts, part);
}

// Root of a s² + 2b s + c in [x.lo, x.hi], where it changes its sign once: interval Newton.
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

// The side of a cone where the square's coefficient may be 0: by the signs at the two caps.
static bool FN(clip_steep)(struct FN(part) * part, struct IV a, struct IV b, struct IV c) {
    struct IV x = part->in, y = part->out;
    if (!(x.lo > -(REAL)INFINITY) || !(y.hi < (REAL)INFINITY)) {
        part->sure = false;
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
        part->out = FN(quadratic_root)(a, b, c, between);
        part->out_face = FACE_SIDE;
        part->out_face_sure = true;
    } else if (p > 0 && q < 0) {
        part->in = FN(quadratic_root)(a, b, c, between);
        part->in_face = FACE_SIDE;
        part->in_face_sure = true;
    } else if (p > 0 && q > 0) { // below its chord by |a|·length²/4 at most
        struct IV length = FN(sub)(y, x);
        struct IV sag = FN(scale)(FN(mul)((struct IV){0, FN(magnitude)(a)}, FN(sqr)(length)), 0.25);
        REAL least = at_in.lo < at_out.lo ? at_in.lo : at_out.lo;
        if (least > sag.hi)
            return false;
        part->sure = false;
    } else
        part->sure = false;
    return true;
}

// Between the caps, and ρ ≤ r(y) = middle + slope·y: one side of a double cone.
static void FN(in_cone)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                        struct FN(parts) * parts) {
    struct FN(part) part = FN(whole);
    const struct IV *o = ray->o, *d = ray->d;
    struct IV half = FN(point)(shape->cone.half_height);
    struct IV r1 = FN(point)(shape->cone.bottom_radius), r2 = FN(point)(shape->cone.top_radius);
    if (!FN(clip)(&part, FN(sub)(o[1], half), d[1], range, FACE_TOP) ||
        !FN(clip)(&part, FN(sub)(FN(neg)(o[1]), half), FN(neg)(d[1]), range, FACE_BOTTOM))
        return;
    struct IV slope = FN(div)(FN(sub)(r2, r1), FN(add)(half, half));
    struct IV here = FN(add)(FN(scale)(FN(add)(r1, r2), 0.5), FN(mul)(slope, o[1]));
    struct IV growth = FN(mul)(slope, d[1]);
    struct IV a = FN(sub)(FN(add)(FN(sqr)(d[0]), FN(sqr)(d[2])), FN(sqr)(growth));
    struct IV b = FN(sub)(FN(add)(FN(mul)(o[0], d[0]), FN(mul)(o[2], d[2])), FN(mul)(here, growth));
    struct IV c = FN(sub)(FN(add)(FN(sqr)(o[0]), FN(sqr)(o[2])), FN(sqr)(here));
    struct IV disc = FN(sub)(FN(sqr)(b), FN(mul)(a, c));
    int bend = FN(sign)(a);
    bool left = true;
    if (bend > 0)
        left = FN(clip_round)(&part, a, b, disc, FACE_SIDE);
    else if (bend < 0 && FN(sign)(growth) != 0 && disc.lo > 0) {
        // Inside beyond the roots, which for a < 0 stand in the other order.
        struct IV root = FN(root)(disc), minus_b = FN(neg)(b);
        if (growth.lo > 0)
            FN(begins)(&part, FN(div)(FN(sub)(minus_b, root), a), FACE_SIDE);
        else
            FN(ends)(&part, FN(div)(FN(add)(minus_b, root), a), FACE_SIDE);
    } else
        left = FN(clip_steep)(&part, a, b, c);
    if (left)
        FN(keep)(parts, part);
}
