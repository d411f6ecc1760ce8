// Walks through the cells of a repeated shape in the ray's order; each copy is clipped to its own cell. Where the order of
// two walls is not certain, the cells of both orders are searched: a cell that the ray misses gives no span, or a
// doubtful one. So the walk visits a superset of the ray's cells. Included by first_hit_body.h.

// Clips the span to a cell. Returns false if nothing is left.
static bool FN(clip_to_cell)(const struct shape *shape, const struct FN(ray) * ray, struct IV range,
                             const double cell[3], struct FN(span) * span) {
    for (int i = 0; i < 3; i++) {
        if (!(shape->repeat[i] > 0))
            continue;
        struct IV size = FN(point)(shape->repeat[i]), k = FN(point)(cell[i]);
        struct IV half = FN(point)(0.5);
        struct IV low = FN(mul)(size, FN(sub)(k, half)), high = FN(mul)(size, FN(add)(k, half));
        if (!FN(clip)(span, FN(sub)(ray->o[i], high), ray->d[i], range, FACE_CELL + 2 * i + 1) ||
            !FN(clip)(span, FN(sub)(low, ray->o[i]), FN(neg)(ray->d[i]), range, FACE_CELL + 2 * i))
            return false;
    }
    return span->in.lo <= span->out.hi;
}

// The largest whole number that is not above x; beyond 2⁶² every number is whole.
static REAL FN(floor)(REAL x) {
    if (x >= (REAL)0x1p62 || x <= -(REAL)0x1p62)
        return x;
    REAL whole = (REAL)(long)x;
    return whole > x ? whole - 1 : whole;
}

// The span that may go on in the next cell: pending while it may also hold the ray's start.
struct FN(carried) {
    struct FN(span) span;
    bool pending;
};

// Takes the spans of the copy in one cell, joined to the carried one where the solid goes on through the wall.
// Returns true if no further cell can matter.
static bool FN(search_cell)(struct FN(search) * search, const struct solid *solid, int index,
                            const struct FN(ray) * ray, struct IV range, const double cell[3],
                            struct FN(carried) * last, long *evals) {
    const struct shape *shape = solid->shape;
    struct FN(span) walls = FN(whole_ray);
    if (!FN(clip_to_cell)(shape, ray, range, cell, &walls))
        return false;
    struct FN(ray) local = *ray;
    for (int i = 0; i < 3; i++)
        local.o[i] = FN(sub)(ray->o[i], FN(mul)(FN(point)(shape->repeat[i]), FN(point)(cell[i])));
    struct FN(spans) spans;
    struct IV within = {walls.in.lo > range.lo ? walls.in.lo : range.lo,
                        walls.out.hi < range.hi ? walls.out.hi : range.hi};
    if (!(within.lo <= within.hi))
        return false;
    FN(copy_spans)(solid, local, within, &spans, evals);
    if (spans.overflow)
        FN(note_doubt)(search, walls.in.lo);
    for (int i = 0; i < spans.count; i++) {
        struct FN(span) span = spans.at[i];
        FN(clip_start)(&span, walls.in, walls.in_face);
        FN(clip_end)(&span, walls.out, walls.out_face);
        span.sure = span.sure && walls.sure && span.in.hi < span.out.lo;
        if (span.in.lo > span.out.hi)
            continue;
        memcpy(span.in_cell, cell, sizeof span.in_cell);
        memcpy(span.out_cell, cell, sizeof span.out_cell);
        bool joins = last->span.out_face >= FACE_CELL && span.in_face >= FACE_CELL &&
                     last->span.out.hi >= span.in.lo;
        if (joins && last->pending) {
            struct FN(span) *begun = &last->span;
            begun->sure = begun->sure && span.sure && begun->out_face_sure && span.in_face_sure;
            begun->out = span.out;
            begun->out_face = span.out_face;
            begun->out_face_sure = span.out_face_sure;
            memcpy(begun->out_cell, cell, sizeof begun->out_cell);
            continue;
        }
        if (last->pending && FN(take_span)(search, index, &last->span))
            return true;
        last->span = span;
        last->pending = !(span.in.lo > 0);
        if (!last->pending && FN(take_span)(search, index, &span))
            return true;
    }
    return false;
}

// One axis of the walk: the cells that the ray may be in, and the s of the wall that it goes to.
struct FN(axis) {
    int direction; // its sign; 0: along the walls, or not certain
    double low, high;
    struct IV wall;
};

// The numbers of the cells that x may be in.
static struct IV FN(cells_at)(struct IV x, double size) {
    struct IV place = FN(add)(FN(div)(x, FN(point)(size)), FN(point)(0.5));
    return (struct IV){FN(floor)(place.lo), FN(floor)(place.hi)};
}

static struct FN(axis) FN(start_axis)(struct IV o, struct IV d, double size, struct IV range) {
    struct FN(axis) axis = {.wall = {(REAL)INFINITY, (REAL)INFINITY}};
    if (!(size > 0))
        return axis;
    axis.direction = FN(sign)(d);
    struct IV cell = FN(cells_at)(axis.direction ? o : FN(add)(o, FN(mul)(d, range)), size);
    axis.low = (double)cell.lo;
    axis.high = (double)cell.hi;
    return axis;
}

// Searches every cell of the block that was not in the last block, in the ray's order.
static bool FN(search_block)(struct FN(search) * search, const struct solid *solid, int index,
                             const struct FN(ray) * ray, struct IV range, double block[3][2],
                             double searched[3][2], struct FN(carried) * last, long *evals) {
    double step[3], cell[3];
    for (int i = 0; i < 3; i++)
        step[i] = block[i][0] <= block[i][1] ? 1 : -1;
    for (cell[0] = block[0][0]; cell[0] != block[0][1] + step[0]; cell[0] += step[0])
        for (cell[1] = block[1][0]; cell[1] != block[1][1] + step[1]; cell[1] += step[1])
            for (cell[2] = block[2][0]; cell[2] != block[2][1] + step[2]; cell[2] += step[2]) {
                bool again = true; // searched with the last block
                for (int i = 0; i < 3; i++)
                    again = again && cell[i] >= fmin(searched[i][0], searched[i][1]) &&
                            cell[i] <= fmax(searched[i][0], searched[i][1]);
                if (!again && FN(search_cell)(search, solid, index, ray, range, cell, last, evals))
                    return true;
            }
    return false;
}

// Searches a repeated solid cell by cell. Gives up after MAX_CELLS, or where a block would be more than three cells wide.
static void FN(walk_cells)(struct FN(search) * search, const struct solid *solid, int index,
                           const struct FN(ray) * ray, long *evals) {
    const double *size = solid->shape->repeat;
    struct IV range = {0, search->reach.hi};
    struct FN(carried) last = {.span = FN(whole_ray)};
    struct FN(axis) axes[3];
    double block[3][2], searched[3][2] = {{INFINITY, INFINITY}, {0, 0}, {0, 0}};
    for (int i = 0; i < 3; i++)
        axes[i] = FN(start_axis)(ray->o[i], ray->d[i], size[i], range);
    REAL before = 0; // every cell up to here is searched
    for (long cells = 0;; cells++) {
        REAL leaves = (REAL)INFINITY; // s at which the ray has left the block
        bool wide = false;
        for (int i = 0; i < 3; i++) {
            struct FN(axis) *axis = &axes[i];
            wide = wide || !(axis->high - axis->low <= 2) || !(fabs(axis->high) < 0x1p52);
            if (axis->direction == 0)
                continue;
            double side = axis->direction > 0 ? axis->high + 0.5 : axis->low - 0.5;
            struct IV at = FN(mul)(FN(point)(size[i]), FN(point)(side));
            axis->wall = FN(div)(FN(sub)(at, ray->o[i]), ray->d[i]);
            leaves = axis->wall.hi < leaves ? axis->wall.hi : leaves;
        }
        if (wide || cells > MAX_CELLS) {
            FN(note_doubt)(search, wide ? 0 : before);
            search->gave_up = !wide;
            break;
        }
        for (int i = 0; i < 3; i++) { // and the cells behind walls that the ray may reach by then
            bool may = axes[i].direction != 0 && axes[i].wall.lo <= leaves;
            block[i][0] = axes[i].direction < 0 ? axes[i].high : axes[i].low;
            block[i][1] = axes[i].direction < 0 ? axes[i].low - may : axes[i].high + may;
        }
        if (FN(search_block)(search, solid, index, ray, range, block, searched, &last, evals))
            return;
        bool known = search->best.shape >= 0 && !search->inside && !last.pending &&
                     leaves > search->best.s.hi;
        if (known || !(leaves <= search->reach.hi))
            break;
        for (int i = 0; i < 3; i++) {
            struct FN(axis) *axis = &axes[i];
            if (axis->direction == 0)
                continue;
            bool may = axis->wall.lo <= leaves, must = axis->wall.hi <= leaves;
            if (axis->direction > 0) {
                axis->low = must ? axis->high + 1 : axis->low;
                axis->high += may;
            } else {
                axis->high = must ? axis->low - 1 : axis->high;
                axis->low -= may;
            }
        }
        memcpy(searched, block, sizeof searched);
        before = leaves;
    }
    if (last.pending)
        FN(take_span)(search, index, &last.span);
}
