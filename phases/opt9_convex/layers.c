// Camera rays of a tile among the copies of repeated shapes, front to back.
//
// Rays of 4 × 4 pixels make a bundle, and the walk from cell to cell (walk.h; J. Amanatides and A. Woo, "A fast voxel
// traversal algorithm for ray tracing", Eurographics 1987) is one for a bundle: its axis', the ray through its middle.
// At a distance t no ray of it is further than spread·t from there, and copies stay a gap away from their cells' walls:
// so long as spread·t is less, a ray is in a copy only where the axis is in that one's cell, and the cells that the axis
// goes through are all that there are, in the order in which every ray meets them. Behind that each ray walks by itself.
//
// The lanes are bundles in the walk, rays where a copy is asked (copies.h).
#include "copies.h"

// The camera from the middles of the cells that the lanes are in, as two floats.
static inline real lane_place(const struct grid *grid, int axis, real d, real count, real *rest) {
    COUNT(lane_place, call);
    half size = half_set(grid->size[axis]), eye = half_set(grid->eye[axis]);
    real number = with_sign_of(d, count);
    half low = half_neg_mul_add(half_low(number), size, eye);
    half high = half_neg_mul_add(half_high(number), size, eye);
    real at = narrowed(low, high);
    *rest = narrowed(low - half_low(at), high - half_high(at));
    return at;
}

static inline struct vec lane_places(const struct grid *grid, struct vec d, const struct walk *w,
                                     struct vec *rest) {
    return (struct vec){lane_place(grid, 0, d.x, w->x.count, &rest->x),
                        lane_place(grid, 1, d.y, w->y.count, &rest->y),
                        lane_place(grid, 2, d.z, w->z.count, &rest->z)};
}

static inline struct walk walk_from(const struct grid *grid, struct vec d, const struct placed *s,
                                    real end) {
    return (struct walk){axis_of(set((float)grid->eye[0]), d.x, s->cell[0], s->around[0]),
                         axis_of(set((float)grid->eye[1]), d.y, s->cell[1], s->around[1]),
                         axis_of(set((float)grid->eye[2]), d.z, s->cell[2], s->around[2]), end};
}

// Each ray by itself, from the camera on. What it has met it does not ask again.
INLINE void walk_alone(int first, const struct grid *grid, int block) {
    ACTIVE(count_of(grid->left[block]));
    COUNT(walk_alone, call);
    COUNT(walk_alone, scalar);
    const struct placed *s = &KNOWN(grid->scene)->placed[first];
    const struct sight *at = &grid->sights[block];
    struct vec d = direction_of(first, grid, block);
    struct walk w = walk_from(grid, d, s, least_of(set(2.0f * grid->bounds), at->hit.t));
    for (mask going = grid->left[block]; any(going);) {
        mask met = next_box(&w, going, no_lane());
        if (!any(met))
            return;
        ACTIVE(count_of(met));
        COUNT(walk_alone, met);
        struct vec rest, o = lane_places(grid, d, &w, &rest);
        going = next_cells(&w, but_not(meet_copy(first, grid, block, o, rest, 0, met), met));
    }
}

// As next_box() where some ray of them may meet the box.
static inline mask bundles_next(struct bundles *b, float spread, mask going) {
    COUNT(bundles_next, call);
    struct walk *w = &b->walk;
    mask met = no_lane();
    while (any(going)) {
        ACTIVE(count_of(going));
        COUNT(bundles_next, cell);
        real wide = set(spread) * least_of(leaves_at(&w->x, &w->y, &w->z), w->end);
        real x = mul_add(wide, b->along.x, w->x.half), y = mul_add(wide, b->along.y, w->y.half),
             z = mul_add(wide, b->along.z, w->z.half);
        real in = most_of(w->x.middle - x, most_of(w->y.middle - y, w->z.middle - z));
        real out = least_of(w->x.middle + x, least_of(w->y.middle + y, w->z.middle + z));
        mask here =
            both(both(going, not_less(out, in)), both(greater(out, set(0.0f)), less(in, w->end)));
        met = either(met, here);
        going = next_cells(w, but_not(here, going));
    }
    return met;
}

// The rays of a bundle that go on.
INLINE bool meet_bundle(int first, struct grid *grid, int bundle, struct vec o, struct vec rest,
                        int shape, int axis, unsigned away) {
    bool on = false, whole = shape >= 0;
    int block = bundle / ACROSS * STACKED * ACROSS + bundle % ACROSS;
    for (int k = 0; k < STACKED; k++) {
        const struct sight *at = &grid->sights[block + k * ACROSS];
        whole = whole && !any(at->hit.found);
    }
    for (int k = 0; k < STACKED; k++, block += ACROSS) {
        mask left = grid->left[block];
        if (!any(left))
            continue;
        ACTIVE(count_of(left));
        if (whole) {
            EACH_ALIKE(grid->scene, take_whole, first, shape, axis, grid, block, o, rest);
            grid->left[block] = no_lane();
        } else {
            left = but_not(meet_copy(first, grid, block, o, rest, away, left), left);
            grid->left[block] = left;
            on = on || any(left);
        }
    }
    return on;
}

INLINE void most_bound(int i, int first, const struct prepared *scene, float *most) {
    COUNT(most_bound, call);
    const struct placed *s = &KNOWN(scene)->placed[i];
    if (s->leader == first && s->bound > *most)
        *most = s->bound;
}

// What bundles meet of the copies in their cells; those that go on.
INLINE mask meet_cells_of(int first, struct grid *grid, const struct bundles *b, int from,
                          mask met) {
    ACTIVE(count_of(met));
    COUNT(meet_cells_of, call);
    struct vec d = b->direction, rest, o = lane_places(grid, d, &b->walk, &rest);
    float places[9][LANES], bound = 0;
    EACH_ALIKE(grid->scene, most_bound, first, grid->scene, &bound);
    struct proof p = nothing_proved(o, d, bound, grid);
    EACH_ALIKE(grid->scene, prove, first, grid, b, &p);
    mask possible = less(least_of(p.lo, p.others), set(INFINITY));
    real shape = choose(less(p.hi, p.others), p.shape, set(-1.0f));
    const real all[9] = {o.x, o.y, o.z, rest.x, rest.y, rest.z, shape, p.axis, p.away};
    for (int k = 0; k < 9; k++)
        unload(all[k], places[k]);
    unsigned on = bits(met);
    for (unsigned left = bits(both(met, possible)); left; left &= left - 1) {
        int lane = __builtin_ctz(left);
        struct vec at = {set(places[0][lane]), set(places[1][lane]), set(places[2][lane])};
        struct vec more = {set(places[3][lane]), set(places[4][lane]), set(places[5][lane])};
        if (!meet_bundle(first, grid, from + lane, at, more,
                         grid->alone && is_plain(&KNOWN(grid->scene)->model) ? (int)places[6][lane]
                                                                             : -1,
                         (int)places[7][lane], (unsigned)places[8][lane]))
            on &= ~(1u << lane);
    }
    return lanes_of(on);
}

// Whether the shape i is repeated otherwise than `first`.
INLINE void is_other(int i, int first, const struct prepared *scene, bool *alone) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    *alone = *alone && !(REPEATED(s) && s->leader != first);
}

// What the grid is to the tile; the bundles that have rays.
INLINE unsigned begin_grid(int first, struct grid *grid, const struct mesh *mesh,
                           const struct job *job) {
    const struct placed *s = &KNOWN(job->prepared)->placed[first];
    const struct eye *eye = &job->eyes[first];
    float bounds = (float)KNOWN(job->prepared)->model.march.bounds_radius * (1 + 1e-4f);
    COUNT(begin_grid, call);
    COUNT(begin_grid, scalar);
    grid->bounds = bounds;
    grid->alone = true;
    EACH_SHAPE(job->prepared, is_other, first, job->prepared, &grid->alone);
    grid->slack = 2e-6f * bounds;
    grid->spread = 1.5f * 1.41422f * mesh->pixel + 1e-6f;
    for (int k = 0; k < 3; k++) {
        grid->eye[k] = (double)eye->at[k] + (double)eye->rest[k];
        grid->size[k] = s->wide_cell[k];
    }
    unsigned open = 0;
    for (int block = mesh->down * ACROSS; block < BLOCKS; block++) {
        grid->left[block] = no_lane();
        grid->sights[block].hit.found = no_lane();
        grid->sights[block].active = no_lane();
        grid->sights[block].hit.t = set(0.0f);
    }
    mask met = no_lane();
    for (int row = 0; row < mesh->down; row++) {
        for (int block = row * ACROSS; block < row * ACROSS + mesh->across; block++) {
            grid->left[block] = grid->sights[block].active;
            met = either(met, grid->sights[block].hit.found);
        }
        open |= ((1u << mesh->across) - 1) << row / STACKED * ACROSS;
    }
    grid->first = !any(met);
    return open;
}

// How far the rays of some bundles go: to what else they have met, if all have.
INLINE real ends_of(const struct grid *grid, int from, unsigned open) {
    COUNT(ends_of, call);
    COUNT(ends_of, scalar);
    if (grid->first)
        return set(2.0f * grid->bounds);
    float ends[LANES];
    unload(set(2.0f * grid->bounds), ends);
    for (; open; open &= open - 1) {
        int lane = __builtin_ctz(open), bundle = from + lane;
        const struct sight *at =
            &grid->sights[bundle / ACROSS * STACKED * ACROSS + bundle % ACROSS];
        real furthest = set(0.0f);
        bool all = true;
        for (int k = 0; k < STACKED && all; k++) {
            all = !any(but_not(at[k * ACROSS].hit.found, at[k * ACROSS].active));
            furthest = most_of(furthest, keep(at[k * ACROSS].active, at[k * ACROSS].hit.t));
        }
        if (!all)
            continue;
        ACTIVE(LANES);
        COUNT(ends_of, met);
        float far = -least_lane(set(0.0f) - furthest);
        ends[lane] = far < ends[lane] ? far : ends[lane];
    }
    return load(ends);
}

// Until where no ray leaves the cells that its bundle's axis goes through.
static inline float together_until(const struct grid *grid, const struct placed *s) {
    COUNT(together_until, call);
    float gap = INFINITY;
    for (int k = 0; k < 3; k++)
        if (s->cell[k] > 0) {
            COUNT(together_until, axis);
            float own = 0.5f * s->cell[k] - s->around[k] - grid->slack;
            gap = own < gap ? own : gap;
        }
    return gap > 0 && grid->spread < 0.05f ? gap / grid->spread : 0.0f;
}

// The bundles `open` of those from `from` on.
INLINE void meet_bundles(int first, struct grid *grid, const struct mesh *mesh,
                         const struct job *job, int from, unsigned open) {
    ACTIVE(__builtin_popcount(open));
    COUNT(meet_bundles, call);
    COUNT(meet_bundles, scalar);
    const struct placed *s = &KNOWN(job->prepared)->placed[first];
    const struct eye *eye = &job->eyes[first];
    real number = lane_numbers() + set((float)from);
    real row = floor_of(number * set(1.0f / ACROSS)), column = number - row * set(ACROSS);
    real four = set(4.0f * mesh->pixel);
    real x = mul_add(column, four, set(mesh->left + 2.0f * mesh->pixel));
    real y = neg_mul_add(row, four, set(mesh->top - 2.0f * mesh->pixel));
    struct vec d = vec_along(vec_along(vec_set(eye->axis[2]), vec_set(eye->axis[0]), x),
                             vec_set(eye->axis[1]), y);
    d = vec_scale(d, set(1.0f) / vec_norm(d));
    struct bundles b = {.direction = d};
    real end = ends_of(grid, from, open);
    ACTIVE(__builtin_popcount(open));
    real together = set(together_until(grid, s));
    b.walk = walk_from(grid, d, s, least_of(end, together));
    b.along = (struct vec){b.walk.x.size, b.walk.y.size, b.walk.z.size};
    for (mask going = lanes_of(open); any(going);) {
        mask met = bundles_next(&b, grid->spread, going);
        if (!any(met))
            break;
        going = next_cells(&b.walk, meet_cells_of(first, grid, &b, from, met));
    }
    open &= bits(less(together, end));
    for (; open; open &= open - 1) {
        int bundle = from + __builtin_ctz(open), row_of = bundle / ACROSS * STACKED;
        for (int k = 0; k < STACKED; k++)
            if (any(grid->left[(row_of + k) * ACROSS + bundle % ACROSS]))
                walk_alone(first, grid, (row_of + k) * ACROSS + bundle % ACROSS);
    }
}

KNOWN_SHARED void meet_layers(int first, const struct mesh *mesh, const struct job *job,
                              struct sight *sights) {
    if (KNOWN(job->prepared)->placed[first].leader != first ||
        !REPEATED(&KNOWN(job->prepared)->placed[first]))
        return;
    struct grid grid;
    grid.scene = job->prepared;
    grid.sights = sights;
    unsigned open = begin_grid(first, &grid, mesh, job);
    for (int from = 0; from < BUNDLES; from += LANES) {
        unsigned some = open >> from & ((1u << LANES) - 1);
        if (some)
            meet_bundles(first, &grid, mesh, job, from, some);
    }
}
