// Bounds of what a bundle of camera rays hits of the copy in a cell: intervals of t in which its rays may
// enter each shape, from the bundle's axis and the spread of its rays.
#include "repetition/cell_walk.h"

// Bounds the entries into a box: *lo and *hi around the first face that the axis meets, if all rays enter
// through its flat part.
INLINE void bound_box_entry(const struct primitive *s, const struct bundle_walk *b,
                            const struct cell_grid *grid, const struct bundle_bounds *p, vfloat *lo,
                            vfloat *hi, vfloat *axis) {
    const struct cell_walk *w = &b->walk;
    struct vec a = b->along;
    vfloat x = v_nmadd(v_splat(s->size[0] + s->a), a.x, w->x.middle),
           y = v_nmadd(v_splat(s->size[1] + s->a), a.y, w->y.middle),
           z = v_nmadd(v_splat(s->size[2] + s->a), a.z, w->z.middle);
    vfloat in = v_max(x, v_max(y, z)), wide = p->wide;
    vfloat from = v_max(v_nmadd(wide, a.x, x), v_max(v_nmadd(wide, a.y, y), v_nmadd(wide, a.z, z)));
    vfloat to = v_min(v_madd(v_splat(s->size[0] + s->a) + wide, a.x, w->x.middle),
                      v_min(v_madd(v_splat(s->size[1] + s->a) + wide, a.y, w->y.middle),
                            v_madd(v_splat(s->size[2] + s->a) + wide, a.z, w->z.middle)));
    *lo = v_select(v_cmp_lt(to, from), v_splat(INFINITY), v_max(*lo, from));
    vmask on_x = v_cmp_ge(x, in), on_y = v_andnot(on_x, v_cmp_ge(y, in));
    *axis = v_select(on_x, v_splat(0.0f), v_select(on_y, v_splat(1.0f), v_splat(2.0f)));
    // The rays are no further apart than this where they meet that face's plane.
    vfloat steep = v_select(on_x, a.x, v_select(on_y, a.y, a.z));
    vfloat turns = v_splat(grid->spread) * steep;
    vfloat apart =
        v_madd(in * turns, v_splat(1.0f) / (v_splat(1.0f) - turns), v_splat(grid->slack));
    struct vec at = vec_along(p->o, b->direction, in);
    vmask flat_x = v_or(on_x, v_cmp_lt(v_abs(at.x) + apart, v_splat(s->size[0])));
    vmask flat_y = v_or(on_y, v_cmp_lt(v_abs(at.y) + apart, v_splat(s->size[1])));
    vmask flat_z = v_or(v_andnot(v_or(on_x, on_y), v_mask_all()),
                        v_cmp_lt(v_abs(at.z) + apart, v_splat(s->size[2])));
    vmask flat = v_and(v_and(flat_x, flat_y), v_and(flat_z, v_cmp_lt(turns, v_splat(0.5f))));
    *hi = v_select(v_and(flat, v_cmp_gt(in, apart)), in + apart, v_splat(INFINITY));
}

// Updates the bounds by shape i of the grid of `first`.
INLINE void bound_shape_entry(int i, int first, const struct cell_grid *grid,
                              const struct bundle_walk *b, struct bundle_bounds *p) {
    const struct primitive *s = &KNOWN(grid->scene)->primitives[i];
    if (s->leader != first)
        return;
    vfloat none = v_splat(INFINITY), zero = v_splat(0.0f), bound = v_splat(s->bound);
    vfloat over = bound + p->wide, reach = v_msub(over, over, p->square);
    vmask near = v_cmp_gt(reach, zero);
    vfloat lo = p->before - p->wide - v_sqrt(v_max(reach, zero)), hi = none, axis = v_splat(-1.0f);
    if (s->type == SHAPE_SPHERE) {
        vfloat under = bound - p->wide, inside = v_msub(under, under, p->square);
        vmask all = v_and(v_cmp_gt(under, zero), v_cmp_gt(inside, zero));
        vfloat last = p->before + p->wide - v_sqrt(v_max(inside, zero));
        hi = v_select(v_and(all, v_cmp_gt(lo, zero)), last, none);
    } else if (s->type == SHAPE_BOX || s->type == SHAPE_ROUNDED_BOX)
        bound_box_entry(s, b, grid, p, &lo, &hi, &axis);
    lo = v_select(near, lo, none);
    p->away = p->away + v_zero_where(v_cmp_lt(lo, none), v_splat((float)shape_bit(i, first)));
    vmask sooner = v_cmp_lt(hi, p->hi);
    p->others = v_min(p->others, v_select(sooner, p->lo, lo));
    p->lo = v_select(sooner, lo, p->lo);
    p->hi = v_select(sooner, hi, p->hi);
    p->axis = v_select(sooner, axis, p->axis);
    p->shape = v_select(sooner, v_splat((float)i), p->shape);
}

static inline struct bundle_bounds empty_bundle_bounds(struct vec o, struct vec d, float bound,
                                                       const struct cell_grid *grid) {
    vfloat none = v_splat(INFINITY);
    struct bundle_bounds p = {
        .o = o, .before = v_splat(0.0f) - vec_dot(o, d), .lo = none, .hi = none};
    struct vec c = vec_along(o, d, p.before);
    p.square = vec_dot(c, c);
    // How far a ray along d′, within `spread` of d, strays while the copy's ball can matter. The ray leaves the
    // ball by t = bound − o·d′ ≤ bound + before + |o|·spread. A ray that meets the ball has |o| ≤ |before| +
    // bound + spread·t. So t ≤ (|before| + bound)/(1 − spread). bundle_holds_until() keeps spread below .05, and
    // 1.1 is more than 1/.95.
    p.wide = v_madd(v_abs(p.before) + v_splat(bound), v_splat(1.1f * grid->spread),
                    v_splat(grid->slack));
    p.others = none;
    p.shape = p.axis = v_splat(-1.0f);
    p.away = v_splat(0.0f);
    return p;
}

INLINE void max_bound(int i, int first, const struct prepared *scene, float *most) {
    const struct primitive *s = &KNOWN(scene)->primitives[i];
    if (s->leader == first && s->bound > *most)
        *most = s->bound;
}

KERNEL_INLINE void bound_copy_entry(int first, const struct cell_grid *grid,
                                    const struct bundle_walk *b, struct vec o,
                                    struct bundle_bounds *bounds) {
    float bound = 0;
    UNROLL_SHAPES
    for (int i = grid_begin(first); grid_more(i); i = grid_next(grid->scene, i))
        max_bound(i, first, grid->scene, &bound);
    struct bundle_bounds p = empty_bundle_bounds(o, b->direction, bound, grid);
    UNROLL_SHAPES
    for (int i = grid_begin(first); grid_more(i); i = grid_next(grid->scene, i))
        bound_shape_entry(i, first, grid, b, &p);
    *bounds = p;
}
