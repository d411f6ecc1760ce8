// Parts of a ray inside of a rounded box: of three boxes, each wider along one axis, of a cylinder about each edge
// of the box that is grown and of a ball about each of its corners. Together they are convex, so that what the ray
// has of them is one part. Included by solve.c twice.

// Into the one part that solids with a convex union have together.
static void FN(join)(struct FN(part) * all, struct FN(part) part) {
    if (part.in.lo > part.out.hi)
        return;
    all->in.lo = part.in.lo < all->in.lo ? part.in.lo : all->in.lo;
    all->out.hi = part.out.hi > all->out.hi ? part.out.hi : all->out.hi;
    if (!part.sure || !(part.in.hi < part.out.lo))
        return;
    all->in.hi = part.in.hi < all->in.hi ? part.in.hi : all->in.hi;
    all->out.lo = part.out.lo > all->out.lo ? part.out.lo : all->out.lo;
    all->sure = true;
}

// As clip(), between two solids that share the face: a ray along it is in both, for they are closed.
static bool FN(clip_seam)(struct FN(part) * part, struct IV a, struct IV b, struct IV range,
                          int face) {
    return (b.lo == 0 && b.hi == 0 && a.hi <= 0) || FN(clip)(part, a, b, range, face);
}

// Within the rounding of a corner, or of an edge: the axis that is left is the edge's, −1 where none is. `signs`: bits of
// which corner, and of which edge.
static void FN(in_corner)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                          int left, int signs, struct FN(part) * all) {
    struct FN(part) part = FN(whole);
    struct IV zero = {0, 0}, o[3], d[3];
    for (int i = 0; i < 3; i++) {
        struct IV half = FN(point)(shape->box.half_size[i]);
        o[i] = signs >> i & 1 ? FN(sub)(ray->o[i], half) : FN(add)(ray->o[i], half);
        d[i] = ray->d[i];
        if (i != left)
            continue;
        if (!FN(clip_seam)(&part, FN(sub)(ray->o[i], half), d[i], range, 0) ||
            !FN(clip_seam)(&part, FN(sub)(FN(neg)(ray->o[i]), half), FN(neg)(d[i]), range, 0))
            return;
        o[i] = d[i] = zero;
    }
    struct IV a = FN(square)(d), square = FN(sqr)(FN(point)(shape->box.rounding));
    if (FN(sign)(a) > 0) {
        struct IV disc = FN(sub)(FN(mul)(a, square), FN(cross_square)(o, d));
        if (!FN(clip_round)(&part, a, FN(dot)(o, d), disc, 0))
            return;
    } else { // along the edge, or nearly
        struct IV beside = FN(sub)(FN(square)(o), square);
        bool along = a.lo == 0 && a.hi == 0;
        if (along && beside.lo > 0)
            return;
        part.sure = part.sure && along && beside.hi < 0;
    }
    FN(join)(all, part);
}

static bool FN(clip_faces)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                           const bool wide[3], struct FN(part) * part) {
    for (int i = 0; i < 3; i++) {
        struct IV half = FN(point)(shape->box.half_size[i]), o = ray->o[i], d = ray->d[i];
        struct IV above = FN(sub)(o, half), below = FN(sub)(FN(neg)(o), half);
        if (!wide[i]) {
            if (!FN(clip_seam)(part, above, d, range, 2 * i + 1) ||
                !FN(clip_seam)(part, below, FN(neg)(d), range, 2 * i))
                return false;
            continue;
        }
        half = FN(add)(half, FN(point)(shape->box.rounding));
        if (!FN(clip)(part, FN(sub)(o, half), d, range, 2 * i + 1) ||
            !FN(clip)(part, FN(sub)(FN(neg)(o), half), FN(neg)(d), range, 2 * i))
            return false;
    }
    return true;
}

// Whether the ray is surely on the flat part of the face at s.
static bool FN(on_flat)(const struct shape *shape, const struct FN(ray) * ray, struct IV s,
                        int face) {
    for (int i = 0; i < 3; i++) {
        struct IV at = FN(add)(ray->o[i], FN(mul)(ray->d[i], s));
        if (i != face / 2 && !(FN(magnitude)(at) < (REAL)shape->box.half_size[i]))
            return false;
    }
    return true;
}

static void FN(in_rounded_box)(const struct shape *shape, const struct FN(ray) * ray,
                               struct IV range, struct FN(parts) * parts) {
    struct FN(part) part = FN(whole);
    if (!FN(clip_faces)(shape, ray, range, (const bool[3]){true, true, true}, &part))
        return;
    part.sure = part.sure && part.in.hi < part.out.lo;
    if (part.sure && part.in_face_sure && part.out_face_sure && part.in_face >= 0 &&
        part.out_face >= 0 && FN(on_flat)(shape, ray, part.in, part.in_face) &&
        FN(on_flat)(shape, ray, part.out, part.out_face)) { // as most are
        FN(keep)(parts, part);
        return;
    }
    REAL far = (REAL)INFINITY;
    struct FN(part) all = {.in = {far, far}, .out = {-far, -far}};
    all.in_face_sure = all.out_face_sure = true; // its normal goes by the point
    for (int i = 0; i < 3; i++) {
        part = FN(whole);
        if (FN(clip_faces)(shape, ray, range, (const bool[3]){i == 0, i == 1, i == 2}, &part))
            FN(join)(&all, part);
        for (int signs = 0; signs < 8; signs++)
            if (!(signs >> i & 1))
                FN(in_corner)(shape, ray, range, i, signs, &all);
    }
    for (int signs = 0; signs < 8; signs++)
        FN(in_corner)(shape, ray, range, -1, signs, &all);
    // Where what may begin first is not sure to be there, what does is known too roughly: to be looked at again in quads.
    struct IV length = FN(sub)(all.out, all.in);
    all.sure = all.sure && !(all.in.hi - all.in.lo > length.lo * (REAL)0x1p-30) &&
               !(all.out.hi - all.out.lo > length.lo * (REAL)0x1p-30);
    if (!all.sure) {
        all.in.hi = all.out.hi;
        all.out.lo = all.in.lo;
    }
    if (all.in.lo <= all.out.hi)
        FN(keep)(parts, all);
}
