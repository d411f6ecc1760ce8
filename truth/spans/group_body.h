// The spans of a ray inside of a group: where its field is below 0. Included by ray_spans.c, once in doubles and once in
// quads.

static struct FN(jet) FN(group_over)(void *of, REAL lo, REAL m, REAL hi) {
    return FN(field_over)(of, lo, m, hi);
}

static int FN(group_side)(void *of, REAL s) {
    return FN(sign)(FN(field_over)(of, s, s, s).at);
}

// Clips the range to the ball about the group, with a hair more, so that both ends are outside. Returns false if the ray
// misses it.
static bool FN(clip_to_ball)(const struct node *root, const struct FN(ray) * ray,
                             struct IV *range) {
    struct FN(span) ball = FN(whole_ray);
    struct IV o[3], a = FN(norm_sq)(ray->d), size = FN(point)(root->radius * (1 + 0x1p-20));
    if (!(root->radius < INFINITY))
        return true;
    for (int i = 0; i < 3; i++)
        o[i] = FN(sub)(ray->o[i], FN(point)(root->centre[i]));
    struct IV disc = FN(sub)(FN(mul)(a, FN(square)(size)), FN(cross_norm_sq)(o, ray->d));
    if (!FN(clip_quadratic)(&ball, a, FN(dot)(o, ray->d), disc, 0))
        return false;
    range->lo = ball.in.lo > range->lo ? ball.in.lo : range->lo;
    range->hi = ball.out.hi < range->hi ? ball.out.hi : range->hi;
    return range->lo < range->hi;
}

static void FN(group_spans)(const struct solid *solid, const struct FN(ray) * ray, struct IV range,
                            struct FN(spans) * spans, long *evals) {
    if (!FN(clip_to_ball)(&solid->nodes[solid->shape->group.root], ray, &range))
        return;
    struct FN(field) *field = FN(field_open)(solid, ray, false);
    if (!field) { // nothing is known
        spans->overflow = true;
        return;
    }
    struct FN(curve) curve = {field, FN(group_over), FN(group_side), FN(group_side)};
    FN(spans_of_curve)(&curve, range, FN(group_side)(field, range.lo), true, true, spans);
    *evals += FN(field_close)(field);
}
