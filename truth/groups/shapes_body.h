// Signed distances of shapes along a ray: those of sdf.c in closed forms that never divide by a distance, so that they
// keep a slope on the surface. Included by field.c, once in doubles and once in quads.

static struct FN(jet)
    FN(box_jet)(const struct shape *shape, const struct FN(jet) p[3], struct IV away) {
    struct FN(jet) over[3], q[3], zero = FN(number)(0);
    for (int i = 0; i < 3; i++) {
        q[i] = FN(less)(FN(size)(p[i]), shape->box.half_size[i]);
        over[i] = FN(most)(q[i], zero);
    }
    struct FN(jet) low = FN(least)(q[0], q[1]), high = FN(most)(q[0], q[1]);
    // Beside a face, and inside, the distance is the largest coordinate. At an edge or a corner two are above 0.
    struct FN(jet) second = FN(most)(low, FN(least)(high, q[2]));
    return FN(less)(FN(pick)(second, FN(most)(high, q[2]), FN(norm)(3, over, away)),
                    shape->type == SHAPE_ROUNDED_BOX ? shape->box.rounding : 0);
}

// In the plane of (ρ, y) the solid is a convex polygon: inside of it, and where the nearest point is on an edge, the
// distance is the largest of those to the edges' lines; else it is that to a rim.
static struct FN(jet)
    FN(cone_jet)(const struct shape *shape, const struct FN(jet) p[3], struct IV away) {
    double radius[2] = {shape->cone.bottom_radius, shape->cone.top_radius};
    double h = shape->cone.half_height;
    struct IV r1 = FN(point)(radius[0]), r2 = FN(point)(radius[1]), height = FN(point)(2 * h);
    struct IV lean = FN(sub)(r2, r1);
    struct IV length = FN(sqrt)(FN(add)(FN(square)(lean), FN(square)(height)));
    struct IV up = FN(div)(height, length), out = FN(div)(lean, length); // along the side, upward
    struct FN(jet) rho = FN(norm_2)(p[0], p[2], away),
                   y[2] = {FN(less)(p[1], -h), FN(less)(p[1], h)};
    struct FN(jet) from = FN(less)(rho, radius[0]);
    struct FN(jet) side = FN(minus)(FN(times)(from, up), FN(times)(y[0], out));
    struct FN(jet) f = FN(most)(side, FN(most)(y[1], FN(neg_jet)(y[0])));
    for (int end = 0; end < 2; end++) {
        struct FN(jet) beside = FN(less)(rho, radius[end]);
        struct FN(jet) along = FN(plus)(FN(times)(beside, out), FN(times)(y[end], up));
        struct FN(jet) beyond = end ? along : FN(neg_jet)(along);
        f = FN(pick)(FN(least)(beside, beyond), f, FN(norm_2)(beside, y[end], away));
    }
    return f;
}

// As in sdf.c: the distance to a face, or where one axis is far below the others, to an edge or a vertex.
static struct FN(jet)
    FN(octahedron_jet)(const struct shape *shape, const struct FN(jet) p[3], struct IV away) {
    double radius = shape->octahedron.radius;
    struct FN(jet) a[3], zero = FN(number)(0), end = FN(number)(radius);
    for (int i = 0; i < 3; i++)
        a[i] = FN(size)(p[i]);
    struct FN(jet) m = FN(less)(FN(plus)(FN(plus)(a[0], a[1]), a[2]), radius);
    struct IV root = FN(sqrt)(FN(point)(3));
    struct FN(jet) f = FN(times)(m, FN(div)(FN(point)(1), root));
    for (int i = 2; i >= 0; i--) {
        struct FN(jet) y = a[(i + 1) % 3], z = a[(i + 2) % 3];
        struct FN(jet) k = FN(times)(FN(plus)(FN(minus)(z, y), end), FN(point)(0.5));
        k = FN(least)(FN(most)(k, zero), end);
        struct FN(jet) q[3] = {a[i], FN(plus)(FN(less)(y, radius), k), FN(minus)(z, k)};
        struct FN(jet) below = FN(minus)(m, FN(times)(a[i], FN(point)(3)));
        f = FN(pick)(below, f, FN(norm)(3, q, away));
    }
    return f;
}

static struct FN(jet)
    FN(gyroid_jet)(const struct shape *shape, const struct FN(jet) p[3], struct IV away) {
    struct IV cell = FN(point)(shape->gyroid.cell), turn = FN(scale)(FN(pi)(), 2);
    struct IV wave = FN(div)(turn, cell);
    struct FN(jet) s[3], c[3];
    for (int i = 0; i < 3; i++)
        FN(waves)(FN(times)(p[i], wave), away, &s[i], &c[i]);
    struct FN(jet) sum = FN(product)(s[0], c[1], away);
    sum = FN(plus)(sum, FN(product)(s[1], c[2], away));
    sum = FN(plus)(sum, FN(product)(s[2], c[0], away));
    struct IV scale = FN(div)(cell, FN(mul)(turn, FN(sqrt)(FN(point)(3))));
    return FN(less)(FN(times)(FN(size)(sum), scale), shape->gyroid.thickness / 2);
}

static struct FN(jet)
    FN(ellipsoid_jet)(const struct shape *shape, const struct FN(jet) p[3], struct IV away) {
    const double *radius = shape->ellipsoid.radius;
    struct FN(jet) q[3];
    for (int i = 0; i < 3; i++)
        q[i] = FN(times)(p[i], FN(div)(FN(point)(1), FN(point)(radius[i])));
    double least = fmin(radius[0], fmin(radius[1], radius[2]));
    return FN(times)(FN(less)(FN(norm)(3, q, away), 1), FN(point)(least));
}

static struct FN(jet)
    FN(shape_jet)(const struct shape *shape, const struct FN(jet) p[3], struct IV away) {
    switch ((int)shape->type) {
    case SHAPE_SPHERE: return FN(less)(FN(norm)(3, p, away), shape->sphere.radius);
    case SHAPE_PLANE: {
        struct FN(jet) sum = FN(number)(-shape->plane.offset);
        for (int i = 0; i < 3; i++)
            sum = FN(plus)(sum, FN(times)(p[i], FN(point)(shape->plane.normal[i])));
        return sum;
    }
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX: return FN(box_jet)(shape, p, away);
    case SHAPE_TORUS: {
        struct FN(jet) ring = FN(less)(FN(norm_2)(p[0], p[2], away), shape->torus.major_radius);
        return FN(less)(FN(norm_2)(ring, p[1], away), shape->torus.minor_radius);
    }
    case SHAPE_CONE: return FN(cone_jet)(shape, p, away);
    case SHAPE_OCTAHEDRON: return FN(octahedron_jet)(shape, p, away);
    case SHAPE_CAPSULE: {
        struct FN(jet) end = FN(number)(shape->capsule.half_height), q[3] = {p[0], p[1], p[2]};
        q[1] = FN(minus)(q[1], FN(least)(FN(most)(q[1], FN(neg_jet)(end)), end));
        return FN(less)(FN(norm)(3, q, away), shape->capsule.radius);
    }
    case SHAPE_ELLIPSOID: return FN(ellipsoid_jet)(shape, p, away);
    default: return FN(gyroid_jet)(shape, p, away);
    }
}
