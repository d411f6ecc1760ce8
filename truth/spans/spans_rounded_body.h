// The span of a ray inside of a rounded box: the convex union of three boxes, each wider along one axis, a cylinder
// about each edge and a ball about each corner. Included by ray_spans.c, once in doubles and once in quads.

// Joins a span to the one of the convex union.
static void FN(join_span)(struct FN(span) * all, struct FN(span) span) {
    if (span.in.lo > span.out.hi)
        return;
    all->in.lo = span.in.lo < all->in.lo ? span.in.lo : all->in.lo;
    all->out.hi = span.out.hi > all->out.hi ? span.out.hi : all->out.hi;
    if (!span.sure || !(span.in.hi < span.out.lo))
        return;
    all->in.hi = span.in.hi < all->in.hi ? span.in.hi : all->in.hi;
    all->out.lo = span.out.lo > all->out.lo ? span.out.lo : all->out.lo;
    all->sure = true;
}

// As clip(), at a face that two of the solids share. A ray along it is in both, as they are closed.
static bool FN(clip_seam)(struct FN(span) * span, struct IV a, struct IV b, struct IV range,
                          int face) {
    return (b.lo == 0 && b.hi == 0 && a.hi <= 0) || FN(clip)(span, a, b, range, face);
}

// Joins the span in the ball of a corner, or in the cylinder of an edge along axis `left` (−1: a corner).
// signs: a bit for each axis, set on the upper side.
static void FN(corner_span)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                            int left, int signs, struct FN(span) * all) {
    struct FN(span) span = FN(whole_ray);
    struct IV zero = {0, 0}, o[3], d[3];
    for (int i = 0; i < 3; i++) {
        struct IV half = FN(point)(shape->box.half_size[i]);
        o[i] = signs >> i & 1 ? FN(sub)(ray->o[i], half) : FN(add)(ray->o[i], half);
        d[i] = ray->d[i];
        if (i != left)
            continue;
        if (!FN(clip_seam)(&span, FN(sub)(ray->o[i], half), d[i], range, 0) ||
            !FN(clip_seam)(&span, FN(sub)(FN(neg)(ray->o[i]), half), FN(neg)(d[i]), range, 0))
            return;
        o[i] = d[i] = zero;
    }
    struct IV a = FN(norm_sq)(d), square = FN(square)(FN(point)(shape->box.rounding));
    if (FN(sign)(a) > 0) {
        struct IV disc = FN(sub)(FN(mul)(a, square), FN(cross_norm_sq)(o, d));
        if (!FN(clip_quadratic)(&span, a, FN(dot)(o, d), disc, 0))
            return;
    } else { // along the edge, or not certain
        struct IV beside = FN(sub)(FN(norm_sq)(o), square);
        bool along = a.lo == 0 && a.hi == 0;
        if (along && beside.lo > 0)
            return;
        span.sure = span.sure && along && beside.hi < 0;
    }
    FN(join_span)(all, span);
}

// Clips the span to the box that is wider by the rounding along the axes in `wide`.
static bool FN(clip_faces)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                           const bool wide[3], struct FN(span) * span) {
    for (int i = 0; i < 3; i++) {
        struct IV half = FN(point)(shape->box.half_size[i]), o = ray->o[i], d = ray->d[i];
        struct IV above = FN(sub)(o, half), below = FN(sub)(FN(neg)(o), half);
        if (!wide[i]) {
            if (!FN(clip_seam)(span, above, d, range, 2 * i + 1) ||
                !FN(clip_seam)(span, below, FN(neg)(d), range, 2 * i))
                return false;
            continue;
        }
        half = FN(add)(half, FN(point)(shape->box.rounding));
        if (!FN(clip)(span, FN(sub)(o, half), d, range, 2 * i + 1) ||
            !FN(clip)(span, FN(sub)(FN(neg)(o), half), FN(neg)(d), range, 2 * i))
            return false;
    }
    return true;
}

// Whether the ray is certainly on the flat part of the face at s.
static bool FN(on_flat)(const struct shape *shape, const struct FN(ray) * ray, struct IV s,
                        int face) {
    for (int i = 0; i < 3; i++) {
        struct IV at = FN(add)(ray->o[i], FN(mul)(ray->d[i], s));
        if (i != face / 2 && !(FN(magnitude)(at) < (REAL)shape->box.half_size[i]))
            return false;
    }
    return true;
}

static void FN(rounded_box_spans)(const struct shape *shape, const struct FN(ray) * ray,
                                  struct IV range, struct FN(spans) * spans) {
    struct FN(span) span = FN(whole_ray);
    if (!FN(clip_faces)(shape, ray, range, (const bool[3]){true, true, true}, &span))
        return;
    span.sure = span.sure && span.in.hi < span.out.lo;
    if (span.sure && span.in_face_sure && span.out_face_sure && span.in_face >= 0 &&
        span.out_face >= 0 && FN(on_flat)(shape, ray, span.in, span.in_face) &&
        FN(on_flat)(shape, ray, span.out, span.out_face)) { // most rays
        FN(add_span)(spans, span);
        return;
    }
    REAL far = (REAL)INFINITY;
    struct FN(span) all = {.in = {far, far}, .out = {-far, -far}};
    all.in_face_sure = all.out_face_sure =
        true; // the normal follows from the point, not from the face
    for (int i = 0; i < 3; i++) {
        span = FN(whole_ray);
        if (FN(clip_faces)(shape, ray, range, (const bool[3]){i == 0, i == 1, i == 2}, &span))
            FN(join_span)(&all, span);
        for (int signs = 0; signs < 8; signs++)
            if (!(signs >> i & 1))
                FN(corner_span)(shape, ray, range, i, signs, &all);
    }
    for (int signs = 0; signs < 8; signs++)
        FN(corner_span)(shape, ray, range, -1, signs, &all);
    // If the first solid to begin is not sure, the start is known too roughly: quads are needed.
    struct IV length = FN(sub)(all.out, all.in);
    all.sure = all.sure && !(all.in.hi - all.in.lo > length.lo * (REAL)0x1p-30) &&
               !(all.out.hi - all.out.lo > length.lo * (REAL)0x1p-30);
    if (!all.sure) {
        all.in.hi = all.out.hi;
        all.out.lo = all.in.lo;
    }
    if (all.in.lo <= all.out.hi)
        FN(add_span)(spans, all);
}
