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
#include "numerics.h"

// The camera from the middles of the cells that the lanes are in, as two floats.
static inline vfloat lane_place(const struct grid *grid, int axis, vfloat d, vfloat count,
                                vfloat *rest) {
    COUNT(lane_place, call);
    vhalf size = v_half_splat(grid->size[axis]), eye = v_half_splat(grid->eye[axis]);
    vfloat number = v_copysign(count, d);
    vhalf low = v_half_nmadd(v_half_low(number), size, eye);
    vhalf high = v_half_nmadd(v_half_high(number), size, eye);
    vfloat at = v_from_halves(low, high);
    *rest = v_from_halves(low - v_half_low(at), high - v_half_high(at));
    return at;
}

static inline struct vec lane_places(const struct grid *grid, struct vec d, const struct walk *w,
                                     struct vec *rest) {
    return (struct vec){lane_place(grid, 0, d.x, w->x.count, &rest->x),
                        lane_place(grid, 1, d.y, w->y.count, &rest->y),
                        lane_place(grid, 2, d.z, w->z.count, &rest->z)};
}

static inline struct walk walk_from(const struct grid *grid, struct vec d, const struct placed *s,
                                    vfloat end) {
    return (struct walk){axis_of(v_splat((float)grid->eye[0]), d.x, s->cell[0], s->around[0]),
                         axis_of(v_splat((float)grid->eye[1]), d.y, s->cell[1], s->around[1]),
                         axis_of(v_splat((float)grid->eye[2]), d.z, s->cell[2], s->around[2]), end};
}

// Each ray by itself, from the camera on. What it has met it does not ask again.
INLINE void walk_alone(int first, const struct grid *grid, int block) {
    ACTIVE(v_count(grid->left[block]));
    COUNT(walk_alone, call);
    COUNT(walk_alone, scalar);
    const struct placed *s = &KNOWN(grid->scene)->placed[first];
    const struct sight *at = &grid->sights[block];
    struct vec d = direction_of(first, grid, block);
    struct walk w = walk_from(grid, d, s, v_min(v_splat(2.0f * grid->bounds), at->hit.t));
    for (vmask going = grid->left[block]; v_any(going);) {
        vmask met = next_box(&w, going, v_mask_none());
        if (!v_any(met))
            return;
        ACTIVE(v_count(met));
        COUNT(walk_alone, met);
        struct vec rest, o = lane_places(grid, d, &w, &rest);
        going = next_cells(&w, v_andnot(meet_copy(first, grid, block, o, rest, 0, met), met));
    }
}

// As next_box() where some ray of them may meet the box.
static inline vmask bundles_next(struct bundles *b, float spread, vmask going) {
    COUNT(bundles_next, call);
    struct walk *w = &b->walk;
    vmask met = v_mask_none();
    while (v_any(going)) {
        ACTIVE(v_count(going));
        COUNT(bundles_next, cell);
        vfloat wide = v_splat(spread) * v_min(leaves_at(&w->x, &w->y, &w->z), w->end);
        vfloat x = v_madd(wide, b->along.x, w->x.half), y = v_madd(wide, b->along.y, w->y.half),
               z = v_madd(wide, b->along.z, w->z.half);
        vfloat in = v_max(w->x.middle - x, v_max(w->y.middle - y, w->z.middle - z));
        vfloat out = v_min(w->x.middle + x, v_min(w->y.middle + y, w->z.middle + z));
        vmask here = v_and(v_and(going, v_cmp_ge(out, in)),
                           v_and(v_cmp_gt(out, v_splat(0.0f)), v_cmp_lt(in, w->end)));
        met = v_or(met, here);
        going = next_cells(w, v_andnot(here, going));
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
        whole = whole && !v_any(at->hit.found);
    }
    for (int k = 0; k < STACKED; k++, block += ACROSS) {
        vmask left = grid->left[block];
        if (!v_any(left))
            continue;
        ACTIVE(v_count(left));
        if (whole) {
            EACH_ALIKE(grid->scene, take_whole, first, shape, axis, grid, block, o, rest);
            grid->left[block] = v_mask_none();
        } else {
            left = v_andnot(meet_copy(first, grid, block, o, rest, away, left), left);
            grid->left[block] = left;
            on = on || v_any(left);
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
INLINE vmask meet_cells_of(int first, struct grid *grid, const struct bundles *b, int from,
                           vmask met) {
    ACTIVE(v_count(met));
    COUNT(meet_cells_of, call);
    struct vec d = b->direction, rest, o = lane_places(grid, d, &b->walk, &rest);
    float places[9][LANES], bound = 0;
    EACH_ALIKE(grid->scene, most_bound, first, grid->scene, &bound);
    struct proof p = nothing_proved(o, d, bound, grid);
    EACH_ALIKE(grid->scene, prove, first, grid, b, &p);
    vmask possible = v_cmp_lt(v_min(p.lo, p.others), v_splat(INFINITY));
    vfloat shape = v_select(v_cmp_lt(p.hi, p.others), p.shape, v_splat(-1.0f));
    const vfloat all[9] = {o.x, o.y, o.z, rest.x, rest.y, rest.z, shape, p.axis, p.away};
    for (int k = 0; k < 9; k++)
        v_store(all[k], places[k]);
    unsigned on = v_mask_bits(met);
    for (unsigned left = v_mask_bits(v_and(met, possible)); left; left &= left - 1) {
        int lane = __builtin_ctz(left);
        struct vec at = {v_splat(places[0][lane]), v_splat(places[1][lane]),
                         v_splat(places[2][lane])};
        struct vec more = {v_splat(places[3][lane]), v_splat(places[4][lane]),
                           v_splat(places[5][lane])};
        if (!meet_bundle(first, grid, from + lane, at, more,
                         grid->alone && is_plain(&KNOWN(grid->scene)->model) ? (int)places[6][lane]
                                                                             : -1,
                         (int)places[7][lane], (unsigned)places[8][lane]))
            on &= ~(1u << lane);
    }
    return v_mask_of_bits(on);
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
        grid->left[block] = v_mask_none();
        grid->sights[block].hit.found = v_mask_none();
        grid->sights[block].active = v_mask_none();
        grid->sights[block].hit.t = v_splat(0.0f);
    }
    vmask met = v_mask_none();
    for (int row = 0; row < mesh->down; row++) {
        for (int block = row * ACROSS; block < row * ACROSS + mesh->across; block++) {
            grid->left[block] = grid->sights[block].active;
            met = v_or(met, grid->sights[block].hit.found);
        }
        open |= ((1u << mesh->across) - 1) << row / STACKED * ACROSS;
    }
    grid->first = !v_any(met);
    return open;
}

// How far the rays of some bundles go: to what else they have met, if all have.
INLINE vfloat ends_of(const struct grid *grid, int from, unsigned open) {
    COUNT(ends_of, call);
    COUNT(ends_of, scalar);
    if (grid->first)
        return v_splat(2.0f * grid->bounds);
    float ends[LANES];
    v_store(v_splat(2.0f * grid->bounds), ends);
    for (; open; open &= open - 1) {
        int lane = __builtin_ctz(open), bundle = from + lane;
        const struct sight *at =
            &grid->sights[bundle / ACROSS * STACKED * ACROSS + bundle % ACROSS];
        vfloat furthest = v_splat(0.0f);
        bool all = true;
        for (int k = 0; k < STACKED && all; k++) {
            all = !v_any(v_andnot(at[k * ACROSS].hit.found, at[k * ACROSS].active));
            furthest =
                v_max(furthest, v_select_or_zero(at[k * ACROSS].active, at[k * ACROSS].hit.t));
        }
        if (!all)
            continue;
        ACTIVE(LANES);
        COUNT(ends_of, met);
        float far = -least_lane(v_splat(0.0f) - furthest);
        ends[lane] = far < ends[lane] ? far : ends[lane];
    }
    return v_load(ends);
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
    vfloat number = v_iota() + v_splat((float)from);
    vfloat row = v_floor(number * v_splat(1.0f / ACROSS)), column = number - row * v_splat(ACROSS);
    vfloat four = v_splat(4.0f * mesh->pixel);
    vfloat x = v_madd(column, four, v_splat(mesh->left + 2.0f * mesh->pixel));
    vfloat y = v_nmadd(row, four, v_splat(mesh->top - 2.0f * mesh->pixel));
    struct vec d = vec_along(vec_along(vec_set(eye->axis[2]), vec_set(eye->axis[0]), x),
                             vec_set(eye->axis[1]), y);
    d = vec_scale(d, v_splat(1.0f) / vec_norm(d));
    struct bundles b = {.direction = d};
    vfloat end = ends_of(grid, from, open);
    ACTIVE(__builtin_popcount(open));
    vfloat together = v_splat(together_until(grid, s));
    b.walk = walk_from(grid, d, s, v_min(end, together));
    b.along = (struct vec){b.walk.x.size, b.walk.y.size, b.walk.z.size};
    for (vmask going = v_mask_of_bits(open); v_any(going);) {
        vmask met = bundles_next(&b, grid->spread, going);
        if (!v_any(met))
            break;
        going = next_cells(&b.walk, meet_cells_of(first, grid, &b, from, met));
    }
    open &= v_mask_bits(v_cmp_lt(together, end));
    for (; open; open &= open - 1) {
        int bundle = from + __builtin_ctz(open), row_of = bundle / ACROSS * STACKED;
        for (int k = 0; k < STACKED; k++)
            if (v_any(grid->left[(row_of + k) * ACROSS + bundle % ACROSS]))
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
