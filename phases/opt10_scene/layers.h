// Camera rays of a tile among the copies of repeated shapes, front to back: every ray goes from one layer of cells to
// the next, where a cell's layer is how many walls are between it and the camera's, and is in one cell of each. So what
// it meets in a layer is its first hit. A tile's cells of a layer are what its frustum reaches of the neighbours of those
// of the layer before, and each copy is asked by the packets alone whose own frustum it reaches.
//
// All copies as the camera sees them: its place among them is known in doubles once a cell and not once a ray.
#ifndef OPT10_LAYERS_H
#define OPT10_LAYERS_H

#include "walk.h"

#include <stdint.h>

enum {
    ACROSS = TILE_WIDTH / BLOCK_WIDTH,
    DOWN = TILE_HEIGHT / BLOCK_HEIGHT,
    BLOCKS = ACROSS * DOWN
};

// A packet of them: what it has met so far.
struct sight {
    struct vec direction;
    mask active;
    struct found hit;
};

// The planes through the camera between the tile's columns and rows of blocks, as it sees the picture's plane at
// distance 1: their places there.
struct mesh {
    float left, top, step_across, step_down;
    int across, down; // blocks in the picture
};

// visit(i, first, …) for every shape that is repeated as the shape `first` is, and perhaps for others.
#if UNROLLED
#define EACH_ALIKE(scene, visit, first, ...) EACH_SHAPE(scene, visit, first, __VA_ARGS__)
#else
#define EACH_ALIKE(scene, visit, first, ...)                                                       \
    for (int alike_ = (first); alike_ >= 0; alike_ = KNOWN(scene)->placed[alike_].alike)           \
    visit(alike_, first, __VA_ARGS__)
#endif

// Sides of the blocks' columns, of their rows from the top, and the plane through the camera across its view.
enum { SIDES = 16, BELOW = ACROSS + 1, AHEAD = SIDES - 1, PARTS = SIDES / LANES };
_Static_assert(BELOW + DOWN + 1 <= AHEAD, "a bit for each side");
enum { MOST_CELLS = 48 }; // of a layer

// How far copies and cells reach in the direction of a side's normal.
struct sides {
    struct vec normal[PARTS];
    real copy[PARTS], cell[PARTS], copy_back[PARTS], cell_back[PARTS];
};

struct cell {
    uint64_t key;
    int at[3];
    float from[3], rest[3]; // the camera from its middle, and what float has lost of it
    unsigned copy;          // blocks that its copy reaches
};

struct layer {
    int count;
    bool full; // there are more
    struct cell cell[MOST_CELLS];
};

struct grid {
    const struct prepared *scene;
    double eye[3], size[3];
    float half[3], world[3], bounds_sq, far_sq; // the world's origin from the camera
    bool forth[3], back[3];                     // whether some of the rays go there along an axis
    struct sides sides;
    struct sight *sights;
    mask left[BLOCKS]; // rays that have not met a copy
    struct vec direction[BLOCKS], per[BLOCKS];
};

static inline real reach_along(struct vec n, const float half[3]) {
    return mul_add(set(half[0]), absolute(n.x),
                   mul_add(set(half[1]), absolute(n.y), set(half[2]) * absolute(n.z)));
}

static inline struct vec place_side(const float to[3][3], mask column, mask ahead, real at) {
    struct vec n = {choose(column, set(to[0][0]), set(to[1][0])),
                    choose(column, set(to[0][1]), set(to[1][1])),
                    choose(column, set(to[0][2]), set(to[1][2]))},
               forward = vec_set(to[2]);
    return vec_choose(ahead, forward, vec_along(n, forward, set(0.0f) - at));
}

// A shape's reach along the normals of the sides.
INLINE void reach_of_copy(int i, int first, const struct prepared *scene, struct vec n, real length,
                          real *reach) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    if (s->leader != first)
        return;
    COUNT(set_sides, shape);
    *reach = most_of(*reach, least_of(reach_along(n, s->box), set(s->bound) * length));
}

INLINE void set_sides(int first, const struct grid *grid, const struct eye *eye,
                      const struct mesh *mesh, float slack, struct sides *sides) {
    for (int part = 0; part < PARTS; part++) {
        ACTIVE(LANES);
        COUNT(set_sides, call);
        real number = lane_numbers() + set((float)(part * LANES));
        mask column = less(number, set((float)BELOW)), ahead = not_less(number, set((float)AHEAD));
        real across = mul_add(number, set(mesh->step_across), set(mesh->left));
        real down = neg_mul_add(number - set((float)BELOW), set(mesh->step_down), set(mesh->top));
        struct vec n = place_side(eye->axis, column, ahead, choose(column, across, down));
        real length = vec_norm(n), reach = set(0.0f), more = set(slack) * length;
        EACH_ALIKE(grid->scene, reach_of_copy, first, grid->scene, n, length, &reach);
        real cell = reach_along(n, grid->half) + more, copy = reach + more;
        sides->normal[part] = n;
        sides->copy[part] = copy;
        sides->cell[part] = cell;
        sides->copy_back[part] = set(0.0f) - copy;
        sides->cell_back[part] = set(0.0f) - cell;
    }
}

_Static_assert(ACROSS == 8 && DOWN <= 4, "a byte for each row of blocks");

static inline unsigned blocks_of(unsigned in, unsigned out) {
    unsigned columns = in & out >> 1 & ((1u << ACROSS) - 1);
    unsigned rows = out >> BELOW & in >> (BELOW + 1) & ((1u << DOWN) - 1);
    // Each of up to four rows to a byte of its own.
    return in >> AHEAD ? columns * (rows * 0x204081u & 0x1010101u) : 0;
}

// The blocks whose frustum a cell reaches, or its copy.
static inline unsigned reach_blocks(const real *to, const real *forth, const real *back) {
    unsigned in = 0, out = 0;
    for (int part = 0; part < PARTS; part++) {
        ACTIVE(LANES);
        COUNT(reach_blocks, call);
        in |= bits(less(to[part], forth[part])) << part * LANES;
        out |= bits(greater(to[part], back[part])) << part * LANES;
    }
    return blocks_of(in, out);
}

// Whether a cell reaches a block's frustum that has rays left; which blocks its copy does.
static inline bool look_at_cell(const struct sides *sides, struct cell *cell, unsigned open) {
    real to[PARTS];
    for (int part = 0; part < PARTS; part++) {
        COUNT(look_at_cell, call);
        to[part] = vec_dot(sides->normal[part], vec_set(cell->from));
    }
    if (!(reach_blocks(to, sides->cell, sides->cell_back) & open))
        return false;
    cell->copy = reach_blocks(to, sides->copy, sides->copy_back);
    return true;
}

// Whether some of it is within the bounds, and before what else the tile's rays have met.
static inline bool in_reach(const struct grid *grid, const struct cell *cell) {
    COUNT(in_reach, call);
    float outside = 0, away = 0;
    for (int k = 0; k < 3; k++) {
        float gap = fabsf(cell->from[k] + grid->world[k]) - grid->half[k];
        float way = fabsf(cell->from[k]) - grid->half[k];
        gap = gap > 0 ? gap : 0;
        way = way > 0 ? way : 0;
        outside += gap * gap;
        away += way * way;
    }
    return outside < grid->bounds_sq && away < grid->far_sq;
}

static inline double place_cell(const struct grid *grid, const struct cell *cell, int axis) {
    COUNT(place_cell, call);
    return fma(-grid->size[axis], cell->at[axis], grid->eye[axis]);
}

static void add_cell(const struct grid *grid, const struct cell *from, int axis, int step,
                     unsigned open, struct layer *to) {
    COUNT(add_cell, call);
    uint64_t key = from->key + ((uint64_t)(int64_t)step << 20 * axis);
    for (int i = to->count - 1; i >= 0; i--)
        if (to->cell[i].key == key)
            return;
    if (to->count == MOST_CELLS) {
        to->full = true;
        return;
    }
    struct cell *cell = &to->cell[to->count];
    *cell = *from;
    cell->key = key;
    cell->at[axis] += step;
    double exact = place_cell(grid, cell, axis);
    cell->from[axis] = (float)exact;
    if (!look_at_cell(&grid->sides, cell, open) || !in_reach(grid, cell))
        return;
    COUNT(add_cell, added);
    cell->rest[axis] = (float)(exact - (double)cell->from[axis]);
    to->count++;
}

// Away from the camera's cell.
static void add_neighbours(const struct grid *grid, const struct cell *from, unsigned open,
                           struct layer *to) {
    for (int k = 0; k < 3; k++) {
        if (!(grid->half[k] < 1e30f))
            continue;
        if (from->at[k] >= 0 && grid->forth[k])
            add_cell(grid, from, k, 1, open, to);
        if (from->at[k] <= 0 && grid->back[k])
            add_cell(grid, from, k, -1, open, to);
    }
}

// A packet beside a copy.
struct beside {
    struct vec c, d;
    real before, square;
    const struct vec *per;
    mask active, met; // met: it, nearer than something else or not
};

INLINE void meet_alike(int i, int first, const struct prepared *scene, struct beside *b,
                       struct found *hit) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    if (s->leader != first)
        return;
    ACTIVE(count_of(b->active));
    COUNT(meet_copy, shape);
    mask near = both(b->active, less(b->square, set(s->bound_sq)));
    if (!any(near))
        return;
    real in, half = set(0.0f);
    if (s->type == SHAPE_SPHERE || s->type == SHAPE_TORUS) {
        COUNT(meet_copy, half);
        half = root(most_of(set(s->bound_sq) - b->square, set(0.0f)));
    }
    near = enter_nearby(b->c, b->d, b->before, half, b->per, s, near, &in);
    COUNT(meet_copy, near);
    real t = b->before + in;
    near = both(near, greater(t, set(0.0f)));
    b->met = either(b->met, near);
    near = both(near, less(t, hit->t));
    if (!any(near))
        return;
    COUNT(meet_copy, met);
    hit->found = either(hit->found, near);
    hit->t = choose(near, t, hit->t);
    hit->shape = choose(near, set(s->index), hit->shape);
    hit->local = vec_choose(near, vec_along(b->c, b->d, in), hit->local);
}

// A copy, seen from `o`, more by `rest`. Those that meet it.
INLINE mask meet_copy(int first, const struct grid *grid, int block, struct vec o, struct vec rest,
                      mask active) {
    COUNT(meet_copy, call);
    struct beside b;
    b.d = grid->direction[block];
    b.before = set(0.0f) - vec_dot(o, b.d);
    struct vec c = vec_along(o, b.d, b.before);
    b.c = (struct vec){c.x + rest.x, c.y + rest.y, c.z + rest.z};
    b.square = vec_dot(b.c, b.c);
    b.per = &grid->per[block];
    b.active = active;
    b.met = no_lane();
    EACH_ALIKE(grid->scene, meet_alike, first, grid->scene, &b, &grid->sights[block].hit);
    return b.met;
}

// The camera from the middles of the cells that the lanes are in: place_cell() for each lane.
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

// Where a layer has too many cells (the frustum is wide, or far on): each ray by itself, from the camera on. What it has
// met it does not ask again.
INLINE void walk_alone(int first, const struct grid *grid, int block) {
    COUNT(walk_alone, call);
    COUNT(walk_alone, scalar);
    const struct placed *s = &KNOWN(grid->scene)->placed[first];
    const float *around = s->around;
    const struct sight *at = &grid->sights[block];
    struct vec d = grid->direction[block];
    real end = least_of(set(2.0f * sqrtf(grid->bounds_sq)), at->hit.t);
    struct walk w = {axis_of(set((float)grid->eye[0]), d.x, s->cell[0], around[0]),
                     axis_of(set((float)grid->eye[1]), d.y, s->cell[1], around[1]),
                     axis_of(set((float)grid->eye[2]), d.z, s->cell[2], around[2]), end};
    for (mask going = grid->left[block]; any(going);) {
        mask met = next_box(&w, going, no_lane());
        if (!any(met))
            return;
        ACTIVE(count_of(met));
        COUNT(walk_alone, met);
        struct vec o, rest;
        o.x = lane_place(grid, 0, d.x, w.x.count, &rest.x);
        o.y = lane_place(grid, 1, d.y, w.y.count, &rest.y);
        o.z = lane_place(grid, 2, d.z, w.z.count, &rest.z);
        going = next_cells(&w, but_not(meet_copy(first, grid, block, o, rest, met), met));
    }
}

// Asks the copies of a layer; the blocks that have rays left.
INLINE unsigned meet_layer(int first, struct grid *grid, const struct layer *layer, unsigned open) {
    for (int i = 0; i < layer->count; i++) {
        const struct cell *cell = &layer->cell[i];
        struct vec o = vec_set(cell->from), rest = vec_set(cell->rest);
        for (unsigned blocks = cell->copy & open; blocks; blocks &= blocks - 1) {
            int block = __builtin_ctz(blocks);
            mask left = grid->left[block];
            left = but_not(meet_copy(first, grid, block, o, rest, left), left);
            grid->left[block] = left;
            if (!any(left))
                open &= ~(1u << block);
        }
    }
    return open;
}

INLINE void has_slabs(int i, int first, const struct prepared *scene, bool *slabs) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    *slabs =
        *slabs || (s->leader == first && (s->type == SHAPE_BOX || s->type == SHAPE_ROUNDED_BOX));
}

static inline void go_along(struct grid *grid, const struct eye *eye, const struct mesh *mesh,
                            int k) {
    COUNT(go_along, call);
    float right = mesh->left + ACROSS * mesh->step_across;
    float bottom = mesh->top - DOWN * mesh->step_down;
    float a = eye->axis[0][k] * mesh->left, b = eye->axis[0][k] * right;
    float c = eye->axis[1][k] * mesh->top, d = eye->axis[1][k] * bottom;
    float most = (a > b ? a : b) + (c > d ? c : d), least = (a < b ? a : b) + (c < d ? c : d);
    grid->forth[k] = eye->axis[2][k] + most > -1e-5f;
    grid->back[k] = eye->axis[2][k] + least < 1e-5f;
}

// What the grid is to the tile; the blocks that have rays.
INLINE unsigned begin_grid(int first, struct grid *grid, const struct mesh *mesh,
                           const struct job *job) {
    const struct placed *s = &KNOWN(job->prepared)->placed[first];
    const struct eye *eye = &job->eyes[first];
    float bounds = (float)KNOWN(job->prepared)->model.march.bounds_radius * (1 + 1e-4f);
    COUNT(begin_grid, call);
    COUNT(begin_grid, scalar);
    grid->bounds_sq = bounds * bounds;
    for (int k = 0; k < 3; k++) {
        grid->eye[k] = (double)eye->at[k] + (double)eye->rest[k];
        grid->size[k] = s->wide_cell[k];
        grid->half[k] = s->cell[k] > 0 ? 0.5f * s->cell[k] : 1e30f;
        grid->world[k] = eye->centre[k];
        go_along(grid, eye, mesh, k);
    }
    set_sides(first, grid, eye, mesh, 1e-6f * bounds, &grid->sides);
    bool slabs = false;
    EACH_ALIKE(grid->scene, has_slabs, first, grid->scene, &slabs);
    unsigned open = 0;
    real furthest = set(0.0f);
    for (int row = 0; row < mesh->down; row++)
        for (int i = 0; i < mesh->across; i++) {
            int block = row * ACROSS + i;
            const struct sight *at = &grid->sights[block];
            ACTIVE(count_of(at->active));
            COUNT(begin_grid, packet);
            struct vec d = turned(s, at->direction);
            grid->direction[block] = d;
            grid->left[block] = at->active;
            furthest = most_of(furthest, keep(at->active, at->hit.t));
            if (slabs) {
                COUNT(begin_grid, slabs);
                grid->per[block] = inverses_of(d);
            }
            open |= 1u << block;
        }
    float far = -least_lane(set(0.0f) - furthest);
    grid->far_sq = far * far * (1 + 1e-5f);
    return open;
}

// What a tile's packets meet of all shapes that are repeated as the shape `first` is, if it is the first of them.
INLINE void meet_layers(int first, const struct mesh *mesh, const struct job *job,
                        struct sight *sights) {
    if (KNOWN(job->prepared)->placed[first].leader != first ||
        !REPEATED(&KNOWN(job->prepared)->placed[first]))
        return;
    struct grid grid;
    grid.scene = job->prepared;
    grid.sights = sights;
    unsigned open = begin_grid(first, &grid, mesh, job);
    struct layer layers[2], *layer = &layers[0], *next = &layers[1];
    struct cell *own = &layer->cell[0];
    layer->count = 1;
    own->key = (uint64_t)1 << 62;
    for (int k = 0; k < 3; k++) {
        own->at[k] = 0;
        own->key += (uint64_t)1 << (20 * k + 15);
        own->from[k] = job->eyes[first].at[k];
        own->rest[k] = job->eyes[first].rest[k];
    }
    own->copy = 0;
    look_at_cell(&grid.sides, own, open);
    while (layer->count > 0) {
        open = meet_layer(first, &grid, layer, open);
        next->count = 0;
        next->full = false;
        for (int i = 0; i < layer->count && open; i++)
            add_neighbours(&grid, &layer->cell[i], open, next);
        if (next->full) {
            for (; open; open &= open - 1)
                walk_alone(first, &grid, __builtin_ctz(open));
            return;
        }
        struct layer *last = layer;
        layer = next;
        next = last;
    }
}

#endif
