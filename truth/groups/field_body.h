// The field of a node tree along a ray. Included by field.c, once in doubles and once in quads.

// An interval that the search is in: what was dropped in it counts for the intervals within it.
struct FN(stage) {
    REAL lo, hi;
    int first; // of the dropped nodes
};

struct FN(field) {
    const struct solid *group, *solids; // solids: of the nodes
    const struct node *nodes;
    int root, count;
    bool outer;
    long evals;
    struct FN(ray) ray;
    struct IV away;
    const struct material *materials; // NULL: not asked for
    struct FN(term) * terms;          // a stack
    int *dropped, dropped_count, used, depth;
    bool *dead;
    struct FN(stage) stages[DEEPEST];
};

struct FN(field) *
    FN(field_open)(const struct solid *group, const struct FN(ray) * ray, bool outer) {
    struct FN(field) *field = malloc(sizeof *field);
    int root = group->shape->group.root, count = group->nodes[root].end - root;
    size_t each = sizeof *field->terms + sizeof *field->dropped + sizeof *field->dead;
    void *memory = field ? malloc((size_t)count * each) : NULL;
    if (!memory) {
        free(field);
        return NULL;
    }
    *field = (struct FN(field)){.group = group,
                                .solids = group->inside,
                                .nodes = group->nodes,
                                .root = root,
                                .count = count,
                                .outer = outer,
                                .ray = *ray,
                                .terms = memory};
    field->dropped = (int *)(field->terms + count);
    field->dead = (bool *)(field->dropped + count);
    memset(field->dead, 0, (size_t)count * sizeof *field->dead);
    return field;
}

long FN(field_close)(struct FN(field) * field) {
    long evals = field ? field->evals : 0;
    if (field)
        free(field->terms);
    free(field);
    return evals;
}

// q − cell·k with the k of the nearest copy. Across a border the field may jump.
static struct FN(jet) FN(wrap)(struct FN(jet) q, double cell) {
    struct IV size = FN(point)(cell), half = {-cell / 2, cell / 2}, k[2];
    struct IV *part[2] = {&q.at, &q.over};
    for (int i = 0; i < 2; i++) {
        struct IV place = FN(add)(FN(div)(*part[i], size), FN(point)(0.5));
        bool far = !(FN(magnitude)(place) < (REAL)0x1p30);
        k[i] = (struct IV){far ? 0 : (REAL)floor(double_below(place.lo)),
                           far ? 1 : (REAL)floor(double_above(place.hi))};
        bool one = k[i].lo == k[i].hi;
        q.rough = q.rough || (i == 1 && !one);
        *part[i] = one ? FN(sub)(*part[i], FN(mul)(size, k[i])) : half;
    }
    return q;
}

// Takes a point of the parent's coordinates to the solid's own, by position, rotation and repeat.
static void FN(to_own)(const struct solid *solid, const struct FN(jet) p[3], struct FN(jet) q[3]) {
    struct FN(jet) moved[3];
    for (int i = 0; i < 3; i++)
        moved[i] = FN(less)(p[i], solid->shape->position[i]);
    for (int i = 0; i < 3; i++) {
        q[i] = moved[i];
        if (solid->rotated) {
            const struct IV *row = solid->FN(rotation)[i];
            q[i] = FN(times)(moved[0], row[0]);
            q[i] = FN(plus)(q[i], FN(times)(moved[1], row[1]));
            q[i] = FN(plus)(q[i], FN(times)(moved[2], row[2]));
        }
        if (solid->shape->repeat[i] > 0)
            q[i] = FN(wrap)(q[i], solid->shape->repeat[i]);
    }
}

// Twists the point, moved to twist_radius from the axis if it is farther. Returns how far it was.
static struct FN(jet) FN(twist)(const struct node *node, struct FN(jet) q[3], struct IV away) {
    struct FN(jet) rho = FN(norm_2)(q[0], q[2], away), x = q[0], z = q[2], s, c;
    struct FN(jet) limit = FN(number)(node->twist_radius);
    if (rho.over.hi > (REAL)node->twist_radius) {
        struct FN(jet) inward = FN(inverse)(node->twist_radius, FN(most)(rho, limit), away);
        x = FN(product)(x, inward, away);
        z = FN(product)(z, inward, away);
    }
    FN(waves)(FN(times)(q[1], FN(point)(node->twist)), away, &s, &c);
    q[0] = FN(minus)(FN(product)(x, c, away), FN(product)(z, s, away));
    q[2] = FN(plus)(FN(product)(x, s, away), FN(product)(z, c, away));
    return rho;
}

static void FN(drop)(struct FN(field) * field, int node) {
    field->dead[node - field->root] = true;
    field->dropped[field->dropped_count++] = node;
}

static struct FN(term)
    FN(node_field)(struct FN(field) * field, int index, const struct FN(jet) p[3]);

// What an operation knows of its children so far. A child that is certainly above the limit has no part.
struct FN(fold) {
    const struct FN(jet) * p; // in the node's coordinates
    double middle[3], spread; // a ball about p
    struct FN(term) * terms;
    int count;
    REAL limit;
};

static void FN(take_child)(struct FN(field) * field, int parent, int child,
                           struct FN(fold) * fold) {
    const struct node *node = &field->nodes[parent];
    bool negative = node->operation == NODE_INTERSECTION ||
                    (node->operation == NODE_DIFFERENCE && child == parent + 1);
    double bound = bound_by_sphere(&field->nodes[child], fold->middle, fold->spread);
    if (!negative && bound > 0 && bound > fold->limit) {
        FN(drop)(field, child);
        return;
    }
    field->used += fold->count;
    struct FN(term) term = FN(node_field)(field, child, fold->p);
    field->used -= fold->count;
    term.jet = negative ? FN(neg_jet)(term.jet) : term.jet;
    term.node = child;
    fold->terms[fold->count++] = term;
    struct IV most = {term.jet.over.hi, term.jet.over.hi};
    most = FN(add)(most, FN(point)(node->blend));
    fold->limit = most.hi < fold->limit ? most.hi : fold->limit;
}

// The operation of a node. A child that is certainly farther than the least by more than the blend, all over the
// interval, is dropped for the intervals within it (T. Duff, "Interval arithmetic and recursive subdivision for implicit
// functions and constructive solid geometry", SIGGRAPH 1992).
static struct FN(term) FN(operate)(struct FN(field) * field, int index, const struct FN(jet) p[3]) {
    const struct node *nodes = field->nodes, *node = &nodes[index];
    struct FN(fold) fold = {.p = p, .terms = field->terms + field->used, .limit = (REAL)INFINITY};
    for (int i = 0; i < 3; i++) {
        double half = (double)(p[i].over.hi - p[i].over.lo) / 2;
        fold.middle[i] = (double)FN(mid)(p[i].over);
        fold.spread += half * half;
    }
    fold.spread = sqrt(fold.spread) * (1 + 1e-12); // against rounding
    int start = -1; // the nearest child of a union by the spheres, as it drops most of the others
    double nearest = INFINITY;
    for (int i = index + 1; i < node->end; i = nodes[i].end) {
        if (field->dead[i - field->root])
            continue;
        double bound = node->operation == NODE_UNION
                           ? bound_by_sphere(&nodes[i], fold.middle, fold.spread)
                           : INFINITY;
        if (start < 0 || bound < nearest) {
            nearest = bound;
            start = i;
        }
    }
    FN(take_child)(field, index, start, &fold);
    for (int i = index + 1; i < node->end; i = nodes[i].end)
        if (i != start && !field->dead[i - field->root])
            FN(take_child)(field, index, i, &fold);
    int kept = 0;
    for (int i = 0; i < fold.count; i++) {
        if (fold.terms[i].jet.over.lo > fold.limit)
            FN(drop)(field, fold.terms[i].node);
        else
            fold.terms[kept++] = fold.terms[i];
    }
    struct FN(term) all = fold.terms[0];
    if (kept > 1)
        all = node->blend > 0 ? FN(blended)(fold.terms, kept, node->blend, field->away)
                              : FN(sharp)(fold.terms, kept);
    all.jet = node->operation == NODE_UNION ? all.jet : FN(neg_jet)(all.jet);
    return all;
}

// amplitude·sin(frequency[0]·qx)·sin(…·qy)·sin(…·qz)
static struct FN(jet)
    FN(displacement)(const struct node *node, const struct FN(jet) q[3], struct IV away) {
    struct FN(jet) all = FN(number)(node->amplitude), s, c;
    for (int i = 0; i < 3; i++) {
        FN(waves)(FN(times)(q[i], FN(point)(node->frequency[i])), away, &s, &c);
        all = FN(product)(all, s, away);
    }
    return all;
}

static struct FN(term)
    FN(node_field)(struct FN(field) * field, int index, const struct FN(jet) p[3]) {
    const struct node *node = &field->nodes[index];
    struct FN(jet) q[3], r[3], rho = FN(number)(-1);
    FN(to_own)(&field->solids[index], p, q);
    for (int i = 0; i < 3; i++)
        r[i] = q[i] = node->mirror[i] ? FN(size)(q[i]) : q[i];
    if (node->twist != 0)
        rho = FN(twist)(node, r, field->away);
    struct FN(term) term = {.node = index, .sure = true};
    if (node->operation != NODE_SHAPE)
        term = FN(operate)(field, index, r);
    else {
        term.jet = FN(shape_jet)(&node->shape, r, field->away);
        if (field->materials)
            term.material = field->materials[node->shape.material];
    }
    if (rho.over.hi > (REAL)node->twist_radius)
        term.jet = FN(pick)(FN(less)(rho, node->twist_radius), term.jet,
                            FN(most)(term.jet, FN(less)(rho, node->twist_inner)));
    if (node->amplitude != 0)
        term.jet = FN(plus)(term.jet, FN(displacement)(node, q, field->away));
    if (node->shell > 0)
        term.jet = FN(less)(FN(size)(term.jet), node->shell);
    if (node->offset != 0)
        term.jet = FN(less)(term.jet, node->offset);
    term.jet = FN(tight)(term.jet, field->away);
    return term;
}

// The field on [lo, hi]. Forgets what was dropped in intervals that do not hold this one.
static struct FN(term) FN(evaluate)(struct FN(field) * field, REAL lo, REAL m, REAL hi) {
    while (field->depth > 0) {
        struct FN(stage) *top = &field->stages[field->depth - 1];
        if (top->lo <= lo && hi <= top->hi && field->depth < DEEPEST)
            break;
        while (field->dropped_count > top->first)
            field->dead[field->dropped[--field->dropped_count] - field->root] = false;
        field->depth--;
    }
    field->stages[field->depth++] = (struct FN(stage)){lo, hi, field->dropped_count};
    field->evals++;
    struct IV here = {m, m}, whole = {lo, hi};
    struct FN(jet) p[3], own[3];
    field->away = FN(sub)(whole, here);
    for (int i = 0; i < 3; i++) {
        struct IV o = field->ray.o[i], d = field->ray.d[i];
        p[i] = (struct FN(jet)){
            .at = FN(add)(o, FN(mul)(d, here)), .over = FN(add)(o, FN(mul)(d, whole)), .slope = d};
    }
    if (field->outer)
        FN(to_own)(field->group, p, own);
    return FN(node_field)(field, field->root, field->outer ? own : p);
}

struct FN(jet) FN(field_over)(struct FN(field) * field, REAL lo, REAL m, REAL hi) {
    struct FN(jet) jet = FN(evaluate)(field, lo, m, hi).jet;
    if (jet.rough)
        jet.slope = (struct IV){-(REAL)INFINITY, (REAL)INFINITY};
    return jet;
}
