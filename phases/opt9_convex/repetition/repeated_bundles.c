// Camera rays of a tile among the copies of repeated shapes, front to back.
//
// A bundle is 4 × 4 pixels. It walks from cell to cell along its axis, the ray through its middle (J.
// Amanatides and A. Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987). At distance
// t no ray is further than spread·t from the axis, and copies keep a gap to their cells' walls. While
// spread·t is below the gap, a ray can only be in the copy of the axis's cell. So the axis passes every copy
// that its rays meet, in their order. Beyond that each ray walks by itself.
//
// In the walk a lane is a bundle; at a copy it is a ray (repetition/copy_hit.c).
#include "repetition/cell_walk.h"
#include "types/numerics.h"

// Returns one coordinate of the camera relative to the middle of each lane's cell; *rest gets its low part.
static inline vfloat lane_coordinate(const struct cell_grid *grid, int axis, vfloat d, vfloat count,
                                     vfloat *rest) {
    vhalf size = v_half_splat(grid->size[axis]), eye = v_half_splat(grid->eye[axis]);
    vfloat number = v_copysign(count, d);
    vhalf low = v_half_nmadd(v_half_low(number), size, eye);
    vhalf high = v_half_nmadd(v_half_high(number), size, eye);
    vfloat at = v_from_halves(low, high);
    *rest = v_from_halves(low - v_half_low(at), high - v_half_high(at));
    return at;
}

static inline struct vec lane_points(const struct cell_grid *grid, struct vec d,
                                     const struct cell_walk *w, struct vec *rest) {
    return (struct vec){lane_coordinate(grid, 0, d.x, w->x.count, &rest->x),
                        lane_coordinate(grid, 1, d.y, w->y.count, &rest->y),
                        lane_coordinate(grid, 2, d.z, w->z.count, &rest->z)};
}

static inline struct cell_walk cell_walk_from(const struct cell_grid *grid, struct vec d,
                                              const struct primitive *s, vfloat end) {
    return (struct cell_walk){
        cell_axis_of(v_splat((float)grid->eye[0]), d.x, s->cell[0], s->box_of_grid[0]),
        cell_axis_of(v_splat((float)grid->eye[1]), d.y, s->cell[1], s->box_of_grid[1]),
        cell_axis_of(v_splat((float)grid->eye[2]), d.z, s->cell[2], s->box_of_grid[2]), end};
}

// Walks each ray of a block by itself, from the camera on.
INLINE void walk_single_rays(int first, const struct cell_grid *grid, int block) {
    const struct primitive *s = &KNOWN(grid->scene)->primitives[first];
    const struct primary_hit *at = &grid->hits[block];
    struct vec d = local_direction(first, grid, block);
    struct cell_walk w = cell_walk_from(grid, d, s, v_min(v_splat(2.0f * grid->bounds), at->hit.t));
    for (vmask going = grid->left[block]; v_any(going);) {
        vmask met = next_box(&w, going, v_mask_none());
        if (!v_any(met))
            return;
        struct vec rest, o = lane_points(grid, d, &w, &rest);
        going = next_cells(&w, v_andnot(hit_copy(first, grid, block, o, rest, 0, met), met));
    }
}

// As next_box() for bundles: walks to the next box that some ray of the bundle may meet.
static inline vmask bundles_next(struct bundle_walk *b, float spread, vmask going) {
    struct cell_walk *w = &b->walk;
    vmask met = v_mask_none();
    while (v_any(going)) {
        vfloat wide = v_splat(spread) * v_min(cell_exit(&w->x, &w->y, &w->z), w->end);
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

// Intersects the rays of a bundle with a copy. shape ≥ 0: all rays hit it, across `axis`. Returns whether a
// ray goes on.
INLINE bool hit_bundle(int first, struct cell_grid *grid, int bundle, struct vec o, struct vec rest,
                       int shape, int axis, unsigned away) {
    bool on = false, whole = shape >= 0;
    int block = bundle / BLOCKS_ACROSS * BUNDLE_BLOCKS * BLOCKS_ACROSS + bundle % BLOCKS_ACROSS;
    for (int k = 0; k < BUNDLE_BLOCKS; k++) {
        const struct primary_hit *at = &grid->hits[block + k * BLOCKS_ACROSS];
        whole = whole && !v_any(at->hit.found);
    }
    for (int k = 0; k < BUNDLE_BLOCKS; k++, block += BLOCKS_ACROSS) {
        vmask left = grid->left[block];
        if (!v_any(left))
            continue;
        if (whole) {
            hit_copy_by_all(first, shape, axis, grid, block, o, rest);
            grid->left[block] = v_mask_none();
        } else {
            left = v_andnot(hit_copy(first, grid, block, o, rest, away, left), left);
            grid->left[block] = left;
            on = on || v_any(left);
        }
    }
    return on;
}

// Intersects the bundles `met` with the copies in their cells. Returns the bundles that go on.
INLINE vmask hit_cells_of_bundles(int first, struct cell_grid *grid, const struct bundle_walk *b,
                                  int from, vmask met) {
    struct vec d = b->direction, rest, o = lane_points(grid, d, &b->walk, &rest);
    float places[9][LANES];
    struct bundle_bounds p;
    bound_copy_entry(first, grid, b, o, &p);
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
        if (!hit_bundle(first, grid, from + lane, at, more,
                        grid->only_grid && needs_no_secondary(&KNOWN(grid->scene)->model)
                            ? (int)places[6][lane]
                            : -1,
                        (int)places[7][lane], (unsigned)places[8][lane]))
            on &= ~(1u << lane);
    }
    return v_mask_of_bits(on);
}

// Clears *only if shape i is repeated in another grid than `first`.
INLINE void is_other(int i, int first, const struct prepared *scene, bool *only) {
    const struct primitive *s = &KNOWN(scene)->primitives[i];
    *only = *only && !(REPEATED(s) && s->leader != first);
}

// Sets up the grid for a tile. Returns the bundles that have rays, as bits.
INLINE unsigned begin_cell_grid(int first, struct cell_grid *grid, const struct block_grid *blocks,
                                const struct job *job) {
    const struct primitive *s = &KNOWN(job->prepared)->primitives[first];
    const struct local_camera *camera = &job->cameras[first];
    float bounds = (float)KNOWN(job->prepared)->model.march.bounds_radius * (1 + 1e-4f);
    grid->bounds = bounds;
    grid->only_grid = true;
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(job->prepared)->model.shape_count; i++)
        is_other(i, first, job->prepared, &grid->only_grid);
    grid->slack = 2e-6f * bounds;
    grid->spread = 1.5f * 1.41422f * blocks->pixel + 1e-6f;
    for (int k = 0; k < 3; k++) {
        grid->eye[k] = (double)camera->at[k] + (double)camera->at_low[k];
        grid->size[k] = s->wide_cell[k];
    }
    unsigned open = 0;
    for (int block = blocks->down * BLOCKS_ACROSS; block < BLOCKS; block++) {
        grid->left[block] = v_mask_none();
        grid->hits[block].hit.found = v_mask_none();
        grid->hits[block].active = v_mask_none();
        grid->hits[block].hit.t = v_splat(0.0f);
    }
    vmask met = v_mask_none();
    for (int row = 0; row < blocks->down; row++) {
        for (int block = row * BLOCKS_ACROSS; block < row * BLOCKS_ACROSS + blocks->across;
             block++) {
            grid->left[block] = grid->hits[block].active;
            met = v_or(met, grid->hits[block].hit.found);
        }
        open |= ((1u << blocks->across) - 1) << row / BUNDLE_BLOCKS * BLOCKS_ACROSS;
    }
    grid->first = !v_any(met);
    return open;
}

// Returns how far each bundle has to walk: to the furthest hit so far if all its rays have one, else to the
// bounds.
INLINE vfloat bundle_ends(const struct cell_grid *grid, int from, unsigned open) {
    if (grid->first)
        return v_splat(2.0f * grid->bounds);
    float ends[LANES];
    v_store(v_splat(2.0f * grid->bounds), ends);
    for (; open; open &= open - 1) {
        int lane = __builtin_ctz(open), bundle = from + lane;
        const struct primary_hit *at =
            &grid->hits[bundle / BLOCKS_ACROSS * BUNDLE_BLOCKS * BLOCKS_ACROSS +
                        bundle % BLOCKS_ACROSS];
        vfloat furthest = v_splat(0.0f);
        bool all = true;
        for (int k = 0; k < BUNDLE_BLOCKS && all; k++) {
            all = !v_any(v_andnot(at[k * BLOCKS_ACROSS].hit.found, at[k * BLOCKS_ACROSS].active));
            furthest = v_max(furthest, v_select_or_zero(at[k * BLOCKS_ACROSS].active,
                                                        at[k * BLOCKS_ACROSS].hit.t));
        }
        if (!all)
            continue;
        float far = most_lane(furthest);
        ends[lane] = far < ends[lane] ? far : ends[lane];
    }
    return v_load(ends);
}

// Returns the t up to which no ray leaves the cells that its bundle's axis passes.
static inline float bundle_holds_until(const struct cell_grid *grid, const struct primitive *s) {
    float gap = INFINITY;
    for (int k = 0; k < 3; k++)
        if (s->cell[k] > 0) {
            float room = 0.5f * s->cell[k] - s->box_of_grid[k] - grid->slack;
            gap = room < gap ? room : gap;
        }
    return gap > 0 && grid->spread < 0.05f ? gap / grid->spread : 0.0f;
}

// Walks the bundles `open`, bits from bundle `from` on.
INLINE void hit_bundles(int first, struct cell_grid *grid, const struct block_grid *blocks,
                        const struct job *job, int from, unsigned open) {
    const struct primitive *s = &KNOWN(job->prepared)->primitives[first];
    const struct local_camera *camera = &job->cameras[first];
    vfloat number = v_iota() + v_splat((float)from);
    vfloat row = v_floor(number * v_splat(1.0f / BLOCKS_ACROSS)),
           column = number - row * v_splat(BLOCKS_ACROSS);
    vfloat four = v_splat(4.0f * blocks->pixel);
    vfloat x = v_madd(column, four, v_splat(blocks->left + 2.0f * blocks->pixel));
    vfloat y = v_nmadd(row, four, v_splat(blocks->top - 2.0f * blocks->pixel));
    struct vec d = vec_along(vec_along(vec_set(camera->axis[2]), vec_set(camera->axis[0]), x),
                             vec_set(camera->axis[1]), y);
    d = vec_scale(d, v_splat(1.0f) / vec_norm(d));
    struct bundle_walk b = {.direction = d};
    vfloat end = bundle_ends(grid, from, open);
    vfloat together = v_splat(bundle_holds_until(grid, s));
    b.walk = cell_walk_from(grid, d, s, v_min(end, together));
    b.along = (struct vec){b.walk.x.size, b.walk.y.size, b.walk.z.size};
    for (vmask going = v_mask_of_bits(open); v_any(going);) {
        vmask met = bundles_next(&b, grid->spread, going);
        if (!v_any(met))
            break;
        going = next_cells(&b.walk, hit_cells_of_bundles(first, grid, &b, from, met));
    }
    open &= v_mask_bits(v_cmp_lt(together, end));
    for (; open; open &= open - 1) {
        int bundle = from + __builtin_ctz(open), row_of = bundle / BLOCKS_ACROSS * BUNDLE_BLOCKS;
        for (int k = 0; k < BUNDLE_BLOCKS; k++)
            if (v_any(grid->left[(row_of + k) * BLOCKS_ACROSS + bundle % BLOCKS_ACROSS]))
                walk_single_rays(first, grid,
                                 (row_of + k) * BLOCKS_ACROSS + bundle % BLOCKS_ACROSS);
    }
}

KERNEL_INLINE void hit_repeated(int first, const struct block_grid *blocks, const struct job *job,
                                struct primary_hit *hits) {
    if (KNOWN(job->prepared)->primitives[first].leader != first ||
        !REPEATED(&KNOWN(job->prepared)->primitives[first]))
        return;
    struct cell_grid grid;
    grid.scene = job->prepared;
    grid.hits = hits;
    unsigned open = begin_cell_grid(first, &grid, blocks, job);
    for (int from = 0; from < BUNDLES; from += LANES) {
        unsigned some = open >> from & ((1u << LANES) - 1);
        if (some)
            hit_bundles(first, &grid, blocks, job, from, some);
    }
}
