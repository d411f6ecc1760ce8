// What a packet of camera rays meets of the copy of repeated shapes whose cell it is in (layers.c): of each shape that is
// repeated alike, ray by ray, or of one that all of them are proved to meet, at once.
#ifndef OPT9_COPIES_H
#define OPT9_COPIES_H

#include "prove.h"

static inline struct vec direction_of(int first, const struct grid *grid, int block) {
    return turned(&KNOWN(grid->scene)->placed[first], grid->sights[block].direction);
}

// A packet beside a copy.
struct beside {
    struct vec c, d, per;
    real before, square;
    mask active, met; // met: it, nearer than something else or not
};

// Its normal is told by what enter_rounded_box() knows.
static inline bool is_round(const struct placed *s) {
    return s->type == SHAPE_ROUNDED_BOX && s->a > ROUND * s->bound;
}

INLINE void meet_alike(int i, int first, const struct prepared *scene, unsigned away,
                       struct beside *b, struct found *hit) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    if (s->leader != first || (away & bit_of(i, first)))
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
    bool plain = is_plain(&KNOWN(scene)->model), round = plain && is_round(s);
    struct vec from_within;
    if (round)
        near = both(near, enter_rounded_box(b->c, b->d, b->per, s, near, &in, &from_within));
    else
        near = enter_nearby(b->c, b->d, b->before, half, &b->per, s, near, &in);
    ACTIVE(count_of(b->active));
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
    struct vec at;
    if (round) {
        COUNT(meet_copy, round);
        COUNT(meet_copy, round_scalar);
        at = vec_scale(from_within, per_length(vec_dot(from_within, from_within), 1.0f / s->a));
    } else {
        COUNT(meet_copy, point);
        at = vec_along(b->c, b->d, in);
        if (plain)
            at = normal_on(at, s);
    }
    hit->local = vec_choose(near, plain ? turned_back(s, at) : at, hit->local);
}

INLINE void has_slabs(int i, int first, const struct prepared *scene, bool *slabs) {
    const struct placed *s = &KNOWN(scene)->placed[i];
    *slabs =
        *slabs || (s->leader == first && (s->type == SHAPE_BOX || s->type == SHAPE_ROUNDED_BOX));
}

// A copy, seen from `o`, more by `rest`; of `away` nothing is met. Those that meet it.
INLINE mask meet_copy(int first, const struct grid *grid, int block, struct vec o, struct vec rest,
                      unsigned away, mask active) {
    COUNT(meet_copy, call);
    struct beside b;
    b.d = direction_of(first, grid, block);
    b.before = set(0.0f) - vec_dot(o, b.d);
    struct vec c = vec_along(o, b.d, b.before);
    b.c = (struct vec){c.x + rest.x, c.y + rest.y, c.z + rest.z};
    b.square = vec_dot(b.c, b.c);
    b.active = active;
    b.met = no_lane();
    b.per = b.d;
    bool slabs = false;
    EACH_ALIKE(grid->scene, has_slabs, first, grid->scene, &slabs);
    if (slabs)
        b.per = inverses_of(b.d);
    EACH_ALIKE(grid->scene, meet_alike, first, grid->scene, away, &b, &grid->sights[block].hit);
    return b.met;
}

// A copy that all of a packet's rays meet, on one face or one sphere of it.
INLINE void take_whole(int i, int first, int shape, int axis, const struct grid *grid, int block,
                       struct vec o, struct vec rest) {
    COUNT(take_whole, call);
    const struct placed *s = &KNOWN(grid->scene)->placed[i];
    if (i != shape || s->leader != first)
        return;
    struct sight *at = &grid->sights[block];
    struct vec d = direction_of(first, grid, block);
    at->hit.found = at->active;
    at->hit.shape = set(s->index);
    at->only = i;
    if (s->type == SHAPE_SPHERE) {
        COUNT(take_whole, sphere);
        real before = set(0.0f) - vec_dot(o, d);
        struct vec c = vec_along(o, d, before);
        c = (struct vec){c.x + rest.x, c.y + rest.y, c.z + rest.z};
        real half = root(most_of(set(s->bound_sq) - vec_dot(c, c), set(0.0f)));
        at->hit.t = before - half;
        at->hit.local = turned_back(s, normal_on(vec_along(c, d, set(0.0f) - half), s));
        return;
    }
    COUNT(take_whole, face);
    COUNT(take_whole, face_scalar);
    real from = axis == 0 ? o.x : axis == 1 ? o.y : o.z;
    real more = axis == 0 ? rest.x : axis == 1 ? rest.y : rest.z;
    real down = axis == 0 ? d.x : axis == 1 ? d.y : d.z;
    real face = with_sign_of(from, set(s->size[axis] + s->a));
    at->hit.t = absolute(face - from - more) / absolute(down);
    real zero = set(0.0f), out = with_sign_of(from, set(1.0f));
    struct vec n = {axis == 0 ? out : zero, axis == 1 ? out : zero, axis == 2 ? out : zero};
    at->hit.local = turned_back(s, n);
}

#endif
