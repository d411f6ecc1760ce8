// A group's operation on its children's fields: sharp, or the smooth minimum of all at once (A. F. T. Martins, R. F.
// Astudillo, "From softmax to sparsemax", ICML 2016; C. Michelot, J. Optim. Theory Appl. 50 (1986)). All operations are a
// least value: of d, of −d, or of −d of the first child and d of the others. Included by field.c.

// A child's value with that sign.
struct FN(term) {
    struct FN(jet) jet;
    int node;
    struct material material;
    bool sure; // the material
};

// Bound 0 and 1: the ends of the value at m; 2 and 3: those of all values.
static REAL FN(bound)(const struct FN(term) * term, int which) {
    struct IV x = which < 2 ? term->jet.at : term->jet.over;
    return which & 1 ? x.hi : x.lo;
}

// The smooth minimum of that bound of the terms, and the level τ with Σ max(τ − d, 0) = blend.
struct FN(smooth) {
    struct IV value, level;
};

// For every τ the minimum is at least φ(τ) = τ − k/2 − Σ max(τ − d, 0)²/2k, a concave function whose maximum it is. At a
// τ ≥ min d with Σ max(τ − d, 0) = k + e the level is off by at most |e|, as the sum's slope is at least 1, and so φ by at
// most e²/k. So rounding in τ does not matter.
static struct FN(smooth)
    FN(smooth_minimum)(const struct FN(term) * terms, int count, double blend, int which) {
    REAL k = blend, least = FN(bound)(terms, which);
    for (int i = 1; i < count; i++) {
        REAL d = FN(bound)(&terms[i], which);
        least = d < least ? d : least;
    }
    REAL level = least + k;
    for (int before = count + 1, active = 0;; before = active, active = 0) {
        REAL sum = 0;
        for (int i = 0; i < count; i++) {
            REAL d = FN(bound)(&terms[i], which);
            if (d < level)
                sum += d - least, active++;
        }
        if (active == 0 || active >= before)
            break;
        level = least + (k + sum) / (REAL)active;
    }
    struct IV at = {level, level}, sum = {-k, -k}, squares = {0, 0};
    for (int i = 0; i < count; i++) {
        REAL d = FN(bound)(&terms[i], which);
        if (!(d < level))
            continue;
        struct IV over = FN(sub)(at, (struct IV){d, d});
        sum = FN(add)(sum, over);
        squares = FN(add)(squares, FN(square)(over));
    }
    struct IV wide = FN(point)(blend), half = FN(scale)(wide, 0.5);
    struct IV gap = FN(div)(FN(square)(sum), wide);
    struct IV off = {sum.lo < 0 ? sum.lo : 0, sum.hi > 0 ? sum.hi : 0};
    struct IV value = FN(sub)(FN(sub)(at, half), FN(scale)(FN(div)(squares, wide), 0.5));
    return (struct FN(smooth)){FN(add)(value, (struct IV){0, gap.hi}), FN(sub)(at, off)};
}

static void FN(mix)(struct FN(term) * sum, const struct FN(term) * term, double weight) {
    for (int i = 0; i < 3; i++)
        sum->material.color[i] += weight * term->material.color[i];
    sum->material.reflectivity += weight * term->material.reflectivity;
    sum->material.shininess += weight * term->material.shininess;
    sum->sure = sum->sure && term->sure;
}

// The smooth minimum rises in every child and is 1-Lipschitz, so its values lie between those of the children's bounds.
// Its slope is the mean of theirs by the weights (τ − d)/blend.
static struct FN(term)
    FN(blended)(const struct FN(term) * terms, int count, double blend, struct IV away) {
    struct FN(term) all = {.node = terms[0].node, .sure = true};
    struct FN(smooth) of[4];
    for (int which = 0; which < 4; which++)
        of[which] = FN(smooth_minimum)(terms, count, blend, which);
    all.jet.at = (struct IV){of[0].value.lo, of[1].value.hi};
    all.jet.over = (struct IV){of[2].value.lo, of[3].value.hi};
    struct IV level = {of[2].level.lo, of[3].level.hi}, wide = FN(point)(blend), zero = {0, 0};
    double here = (double)(of[0].level.lo + of[1].level.hi) / 2, total = 0;
    struct IV first = {0, 0}, hull = {0, 0}, sum = {0, 0};
    for (int i = 0, any = 0; i < count; i++) {
        const struct FN(jet) *jet = &terms[i].jet;
        struct IV weight = FN(later)(FN(div)(FN(sub)(level, jet->over), wide), zero);
        double w = (here - (double)FN(mid)(jet->at)) / blend;
        if (w > 0) {
            FN(mix)(&all, &terms[i], w);
            total += w;
        }
        if (!(weight.hi > 0))
            continue;
        all.jet.rough = all.jet.rough || jet->rough;
        if (!any++) {
            REAL m = FN(mid)(jet->slope);
            first = (struct IV){m, m};
            hull = jet->slope;
        }
        weight.hi = weight.hi < 1 ? weight.hi : 1;
        sum = FN(add)(sum, FN(mul)(weight, FN(sub)(jet->slope, first)));
        hull = FN(hull)(hull, jet->slope);
    }
    struct FN(term) none = {.sure = true};
    if (total > 0)
        FN(mix)(&none, &all, 1 / total);
    all.material = none.material;
    sum = FN(add)(sum, first); // the weights' sum is 1
    all.jet.slope =
        (struct IV){sum.lo > hull.lo ? sum.lo : hull.lo, sum.hi < hull.hi ? sum.hi : hull.hi};
    all.jet = FN(tight)(all.jet, away);
    return all;
}

// The least of the terms. Its material is sure if one term is certainly least, or if all that may be have the same.
static struct FN(term) FN(sharp)(const struct FN(term) * terms, int count) {
    const struct FN(term) *best = terms;
    struct FN(jet) jet = terms->jet;
    bool sure = true;
    REAL least = terms->jet.at.hi;
    for (int i = 1; i < count; i++) {
        const struct FN(term) *term = &terms[i];
        REAL m = FN(mid)(term->jet.at), before = FN(mid)(best->jet.at);
        if (m < before || (m == before && term->node < best->node))
            best = term;
        jet = FN(least)(jet, term->jet);
        least = term->jet.at.hi < least ? term->jet.at.hi : least;
    }
    for (int i = 0; i < count; i++)
        if (!(terms[i].jet.at.lo > least))
            sure = sure && terms[i].sure &&
                   memcmp(&terms[i].material, &best->material, sizeof best->material) == 0;
    return (struct FN(term)){jet, best->node, best->material, sure};
}
