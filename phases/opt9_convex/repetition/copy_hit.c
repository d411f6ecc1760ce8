// Hits of a packet of camera rays on the copy in its cell: shape by shape for each ray, or at once on a shape
// that all rays are proved to hit (repetition/bundle_bounds.c).
#include "repetition/cell_walk.h"

// A packet at a copy. c: each ray's point nearest to the copy, `before` from the origin; square: |c|². met:
// rays that hit the copy, at any t.
struct copy_packet {
    struct vec c, d, per;
    vfloat before, square;
    vmask active, met;
};

// Returns whether enter_rounded_box() also gives the normal.
static inline bool is_mostly_round(const struct primitive *s) {
    return s->type == SHAPE_ROUNDED_BOX && s->a > ROUNDING_SHARE * s->bound;
}

INLINE void hit_shape_of_copy(int i, int first, const struct prepared *scene, unsigned away,
                              struct copy_packet *b, struct surface_hit *hit) {
    const struct primitive *s = &KNOWN(scene)->primitives[i];
    if (s->leader != first || (away & shape_bit(i, first)))
        return;
    vmask near = v_and(b->active, v_cmp_lt(b->square, v_splat(s->bound_sq)));
    if (!v_any(near))
        return;
    vfloat in, half = v_splat(0.0f);
    if (s->type == SHAPE_SPHERE || s->type == SHAPE_TORUS)
        half = v_sqrt(v_max(v_splat(s->bound_sq) - b->square, v_splat(0.0f)));
    bool plain = needs_no_secondary(&KNOWN(scene)->model), round = plain && is_mostly_round(s);
    struct vec from_within;
    if (round)
        near = v_and(near, enter_rounded_box(b->c, b->d, b->per, s, near, &in, &from_within));
    else
        near = enter_nearby(b->c, b->d, b->before, half, &b->per, s, near, &in);
    vfloat t = b->before + in;
    near = v_and(near, v_cmp_gt(t, v_splat(0.0f)));
    b->met = v_or(b->met, near);
    near = v_and(near, v_cmp_lt(t, hit->t));
    if (!v_any(near))
        return;
    hit->found = v_or(hit->found, near);
    hit->t = v_select(near, t, hit->t);
    hit->shape = v_select(near, v_splat(s->index), hit->shape);
    struct vec at;
    if (round) {
        at = vec_scale(from_within, per_length(vec_dot(from_within, from_within), 1.0f / s->a));
    } else {
        at = vec_along(b->c, b->d, in);
        if (plain)
            at = normal_on(at, s);
    }
    hit->local = vec_select(near, plain ? turned_back(s, at) : at, hit->local);
}

INLINE void mark_slabs(int i, int first, const struct prepared *scene, bool *slabs) {
    const struct primitive *s = &KNOWN(scene)->primitives[i];
    *slabs =
        *slabs || (s->leader == first && (s->type == SHAPE_BOX || s->type == SHAPE_ROUNDED_BOX));
}

KERNEL_INLINE vmask hit_copy(int first, const struct cell_grid *grid, int block, struct vec o,
                             struct vec rest, unsigned away, vmask active) {
    struct copy_packet b;
    b.d = local_direction(first, grid, block);
    b.before = v_splat(0.0f) - vec_dot(o, b.d);
    struct vec c = vec_along(o, b.d, b.before);
    b.c = (struct vec){c.x + rest.x, c.y + rest.y, c.z + rest.z};
    b.square = vec_dot(b.c, b.c);
    b.active = active;
    b.met = v_mask_none();
    b.per = b.d;
    bool slabs = false;
    UNROLL_SHAPES
    for (int i = grid_begin(first); grid_more(i); i = grid_next(grid->scene, i))
        mark_slabs(i, first, grid->scene, &slabs);
    if (slabs)
        b.per = inverses_of(b.d);
    UNROLL_SHAPES
    for (int i = grid_begin(first); grid_more(i); i = grid_next(grid->scene, i))
        hit_shape_of_copy(i, first, grid->scene, away, &b, &grid->hits[block].hit);
    return b.met;
}

// Sets the hits of a packet whose rays all hit `shape` of the copy, on the face across `axis` or on its
// sphere.
INLINE void hit_whole_packet(int i, int first, int shape, int axis, const struct cell_grid *grid,
                             int block, struct vec o, struct vec rest) {
    const struct primitive *s = &KNOWN(grid->scene)->primitives[i];
    if (i != shape || s->leader != first)
        return;
    struct primary_hit *at = &grid->hits[block];
    struct vec d = local_direction(first, grid, block);
    at->hit.found = at->active;
    at->hit.shape = v_splat(s->index);
    at->only = i;
    if (s->type == SHAPE_SPHERE) {
        vfloat before = v_splat(0.0f) - vec_dot(o, d);
        struct vec c = vec_along(o, d, before);
        c = (struct vec){c.x + rest.x, c.y + rest.y, c.z + rest.z};
        vfloat half = v_sqrt(v_max(v_splat(s->bound_sq) - vec_dot(c, c), v_splat(0.0f)));
        at->hit.t = before - half;
        at->hit.local = turned_back(s, normal_on(vec_along(c, d, v_splat(0.0f) - half), s));
        return;
    }
    vfloat from = axis == 0 ? o.x : axis == 1 ? o.y : o.z;
    vfloat more = axis == 0 ? rest.x : axis == 1 ? rest.y : rest.z;
    vfloat down = axis == 0 ? d.x : axis == 1 ? d.y : d.z;
    vfloat face = v_copysign(v_splat(s->size[axis] + s->a), from);
    at->hit.t = v_abs(face - from - more) / v_abs(down);
    vfloat zero = v_splat(0.0f), out = v_copysign(v_splat(1.0f), from);
    struct vec n = {axis == 0 ? out : zero, axis == 1 ? out : zero, axis == 2 ? out : zero};
    at->hit.local = turned_back(s, n);
}

KERNEL_INLINE void hit_copy_by_all(int first, int shape, int axis, const struct cell_grid *grid,
                                   int block, struct vec o, struct vec rest) {
    UNROLL_SHAPES
    for (int i = grid_begin(first); grid_more(i); i = grid_next(grid->scene, i))
        hit_whole_packet(i, first, shape, axis, grid, block, o, rest);
}
