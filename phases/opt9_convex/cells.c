// A ray goes from cell to cell of a repeated shape (J. Amanatides and A. Woo, "A fast voxel traversal algorithm for
// ray tracing", Eurographics 1987), every lane in its own, until it meets the box about the copy there; when all
// lanes have or are at their end, those are asked by the shape's closed form.
//
// Only of shapes that are in their cell and its mirror image (cells_hold() in place.c): there the wrapped distance is the
// distance to all copies, and what a march comes to is the first of them.
#include "cells.h"
#include "walk.h"

static inline half half_cell(half o, half t, half d, half count, double cell) {
    return half_neg_mul_add(count, half_set(cell), half_mul_add(t, d, o));
}

// A coordinate at `from` in the copy's frame, rounded once: at the size of the shape, not of the way to it.
static inline real beside_copy(real o, real rest, real d, real from, const struct axis *axis,
                               struct wide_vec direction, const double row[3], double cell) {
    COUNT(beside_copy, call);
    wide start = wide_sum(o, rest), along = wide_dot(direction, row);
    real count = with_sign_of(d, axis->count);
    return narrowed(half_cell(start.low, half_low(from), along.low, half_low(count), cell),
                    half_cell(start.high, half_high(from), along.high, half_high(count), cell));
}

static inline struct vec at_copy(const struct placed *s, const struct among *a, struct vec d,
                                 const struct walk *w, real from) {
    COUNT(at_copy, call);
    real zero = set(0.0f);
    struct wide_vec to = {wide_sum(a->direction.x, zero), wide_sum(a->direction.y, zero),
                          wide_sum(a->direction.z, zero)};
    return (struct vec){
        beside_copy(a->origin.x, a->rest.x, d.x, from, &w->x, to, s->row[0], s->wide_cell[0]),
        beside_copy(a->origin.y, a->rest.y, d.y, from, &w->y, to, s->row[1], s->wide_cell[1]),
        beside_copy(a->origin.z, a->rest.z, d.z, from, &w->z, to, s->row[2], s->wide_cell[2])};
}

SHARED mask enter_cells(const struct placed *s, const struct among *among, real *t,
                        struct vec *local) {
    ACTIVE(count_of(among->active));
    COUNT(enter_cells, call);
    struct vec o = among->origin, d = turned(s, among->direction);
    struct walk w = {axis_of(o.x, d.x, s->cell[0], s->box[0]),
                     axis_of(o.y, d.y, s->cell[1], s->box[1]),
                     axis_of(o.z, d.z, s->cell[2], s->box[2]), among->end};
    mask found = no_lane(), skip = among->leaves;
    *t = set(INFINITY);
    *local = o;
    for (mask going = among->active; any(going); skip = no_lane()) {
        mask met = next_box(&w, going, skip), behind;
        if (!any(met))
            break;
        ACTIVE(count_of(met));
        COUNT(enter_cells, met);
        real from = most_of(into_box(&w), set(0.0f)), in;
        struct vec at;
        mask entered = enter(at_copy(s, among, d, &w, from), d, s, met, &in, &at, &behind);
        // Where `from` is rounded, it may be just behind the entry.
        entered = either(entered, both(behind, greater(from, set(0.0f))));
        *t = choose(entered, from + in, *t);
        *local = vec_choose(entered, at, *local);
        found = either(found, entered);
        going = next_cells(&w, but_not(entered, met));
    }
    return found;
}

static inline mask in_box(const struct placed *s, struct vec p) {
    COUNT(in_box, call);
    return both(less(absolute(p.x), set(s->box[0])),
                both(less(absolute(p.y), set(s->box[1])), less(absolute(p.z), set(s->box[2]))));
}

static inline mask same_place(struct vec a, struct vec b) {
    COUNT(same_place, call);
    real apart = absolute(a.x - b.x) + absolute(a.y - b.y) + absolute(a.z - b.z);
    return not_less(set(0.0f), apart);
}

static struct among among_of(const struct placed *s, struct vec *o, struct vec direction, mask own,
                             mask active, real end) {
    struct vec at = vec_wrapped(s, *o), none = {set(0.0f), set(0.0f), set(0.0f)};
    own = both(own, same_place(at, *o)); // from another cell than its own it may be met
    *o = at;
    return (struct among){at, none, direction, active, own, end};
}

SHARED mask meet_cells(const struct ray *ray, const struct placed *s, mask own, real end,
                       float offset, real *t, struct vec *local) {
    ACTIVE(count_of(ray->active));
    COUNT(meet_cells, call);
    struct vec o = in_frame(s, ray->origin), d = turned(s, ray->direction);
    if (any(own)) {
        COUNT(meet_cells, own);
        struct vec n = normal_on(ray->local, s);
        mask back = less(vec_dot(n, d), set(0.0f));
        o = vec_choose(own, vec_along(ray->local, n, negate_where(back, set(offset))), o);
        own = but_not(back, own); // it was met from within, and so it will be again
    }
    struct among among = among_of(s, &o, ray->direction, own, ray->active, end);
    mask within = both(but_not(among.leaves, ray->active), in_box(s, o));
    if (!s->convex) // a torus may shade itself
        among.leaves = no_lane();
    mask met = enter_cells(s, &among, t, local);
    if (!any(within))
        return met;
    ACTIVE(count_of(within));
    COUNT(meet_cells, within);
    real h = distance_at(o, s, no_lane());
    mask inside = both(within, less(h, set(0.0f)));
    *t = choose(inside, h, *t);
    *local = vec_choose(inside, vec_along(o, d, h), *local);
    return either(met, inside);
}

SHARED void cells_on_the_way(const struct placed *s, int i, struct rays *r,
                             const struct limits *limits) {
    ACTIVE(count_of(r->active));
    COUNT(cells_on_the_way, call);
    mask own = same_shape(r->shape, i);
    struct vec at, o = vec_choose(own, r->local, in_frame(s, r->point));
    real t, end = least_of(r->first, until_bounds(r->point, r->to_light, limits));
    struct among among = among_of(s, &o, r->to_light, own, r->active, end);
    mask in = enter_cells(s, &among, &t, &at);
    in = both(in, less(t, r->first));
    if (any(in)) {
        COUNT(cells_on_the_way, in);
        r->first = choose(in, t, r->first);
        r->cosine = choose(in, slant_at(at, turned(s, r->to_light), s, r), r->cosine);
    }
}

SHARED mask cells_block(const struct placed *s, struct vec origin, struct vec direction, mask own,
                        mask active, real reach) {
    ACTIVE(count_of(active));
    COUNT(cells_block, call);
    struct vec o = origin, at;
    real t;
    struct among among = among_of(s, &o, direction, own, active, reach);
    mask within = both(but_not(s->convex ? among.leaves : no_lane(), active), in_box(s, o));
    if (!s->convex)
        among.leaves = no_lane();
    mask blocked = enter_cells(s, &among, &t, &at);
    blocked = both(blocked, less(t, reach));
    if (!any(within))
        return blocked;
    ACTIVE(count_of(within));
    COUNT(cells_block, within);
    return either(blocked, both(within, less(distance_at(o, s, no_lane()), set(0.0f))));
}
