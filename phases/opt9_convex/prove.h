// What a bundle of camera rays can meet of the copy in a cell, told for all its rays at once: intervals of t in which
// they may enter its shapes, from the bundle's middle ray and how far the others are from it.
#ifndef OPT9_PROVE_H
#define OPT9_PROVE_H

#include "layers.h"
#include "walk.h"

enum {
    BUNDLE_HEIGHT = 4, // and as wide as a block
    STACKED = BUNDLE_HEIGHT / BLOCK_HEIGHT,
    BUNDLES = ACROSS * TILE_HEIGHT / BUNDLE_HEIGHT
};
_Static_assert(BUNDLES % LANES == 0, "whole registers");

struct grid {
    const struct prepared *scene;
    double eye[3], size[3];
    float spread, bounds, slack; // slack: what float may have lost of a place
    bool alone, first;           // no shape is repeated in another way; nothing was met before
    struct sight *sights;
    mask left[BLOCKS]; // rays that have not met a copy
};

// Bundles on their way.
struct bundles {
    struct vec direction, along; // of their axes; along: |1/direction|
    struct walk walk;
};

// Shapes of a copy, a bit for each of those that float counts so; the others have none.
static inline unsigned bit_of(int i, int first) {
    return i - first < 24 ? 1u << (i - first) : 0;
}

// Bundles beside a copy. Of the shape that all their rays have entered by `hi` (∞: there is none): which, across which
// axis, where the first of them may enter it (`lo`); where the first may enter another shape of the copy.
struct proof {
    struct vec o; // the camera
    real before, square,
        wide; // as of struct beside, of their axes; how far from these rays are there
    real lo, hi, others, shape, axis, away; // away: what none of them meets
};

INLINE void prove_box(const struct placed *s, const struct bundles *b, const struct grid *grid,
                      const struct proof *p, real *lo, real *hi, real *axis) {
    COUNT(prove, box);
    COUNT(prove, box_scalar);
    const struct walk *w = &b->walk;
    struct vec a = b->along;
    real x = neg_mul_add(set(s->size[0] + s->a), a.x, w->x.middle),
         y = neg_mul_add(set(s->size[1] + s->a), a.y, w->y.middle),
         z = neg_mul_add(set(s->size[2] + s->a), a.z, w->z.middle);
    real in = most_of(x, most_of(y, z)), wide = p->wide;
    real from = most_of(neg_mul_add(wide, a.x, x),
                        most_of(neg_mul_add(wide, a.y, y), neg_mul_add(wide, a.z, z)));
    real to = least_of(mul_add(set(s->size[0] + s->a) + wide, a.x, w->x.middle),
                       least_of(mul_add(set(s->size[1] + s->a) + wide, a.y, w->y.middle),
                                mul_add(set(s->size[2] + s->a) + wide, a.z, w->z.middle)));
    *lo = choose(less(to, from), set(INFINITY), most_of(*lo, from));
    mask on_x = not_less(x, in), on_y = but_not(on_x, not_less(y, in));
    *axis = choose(on_x, set(0.0f), choose(on_y, set(1.0f), set(2.0f)));
    // On that face's plane the rays are no further apart than this.
    real steep = choose(on_x, a.x, choose(on_y, a.y, a.z));
    real turns = set(grid->spread) * steep;
    real apart = mul_add(in * turns, set(1.0f) / (set(1.0f) - turns), set(grid->slack));
    struct vec at = vec_along(p->o, b->direction, in);
    mask flat_x = either(on_x, less(absolute(at.x) + apart, set(s->size[0])));
    mask flat_y = either(on_y, less(absolute(at.y) + apart, set(s->size[1])));
    mask flat_z = either(but_not(either(on_x, on_y), all_lanes()),
                         less(absolute(at.z) + apart, set(s->size[2])));
    mask flat = both(both(flat_x, flat_y), both(flat_z, less(turns, set(0.5f))));
    *hi = choose(both(flat, greater(in, apart)), in + apart, set(INFINITY));
}

INLINE void prove(int i, int first, const struct grid *grid, const struct bundles *b,
                  struct proof *p) {
    const struct placed *s = &KNOWN(grid->scene)->placed[i];
    if (s->leader != first)
        return;
    COUNT(prove, call);
    real none = set(INFINITY), zero = set(0.0f), bound = set(s->bound);
    real over = bound + p->wide, reach = mul_sub(over, over, p->square);
    mask near = greater(reach, zero);
    real lo = p->before - p->wide - root(most_of(reach, zero)), hi = none, axis = set(-1.0f);
    if (s->type == SHAPE_SPHERE) {
        COUNT(prove, sphere);
        real under = bound - p->wide, inside = mul_sub(under, under, p->square);
        mask all = both(greater(under, zero), greater(inside, zero));
        real last = p->before + p->wide - root(most_of(inside, zero));
        hi = choose(both(all, greater(lo, zero)), last, none);
    } else if (s->type == SHAPE_BOX || s->type == SHAPE_ROUNDED_BOX)
        prove_box(s, b, grid, p, &lo, &hi, &axis);
    lo = choose(near, lo, none);
    p->away = p->away + drop(less(lo, none), set((float)bit_of(i, first)));
    mask sooner = less(hi, p->hi);
    p->others = least_of(p->others, choose(sooner, p->lo, lo));
    p->lo = choose(sooner, lo, p->lo);
    p->hi = choose(sooner, hi, p->hi);
    p->axis = choose(sooner, axis, p->axis);
    p->shape = choose(sooner, set((float)i), p->shape);
}

static inline struct proof nothing_proved(struct vec o, struct vec d, float bound,
                                          const struct grid *grid) {
    COUNT(nothing_proved, call);
    COUNT(nothing_proved, scalar);
    real none = set(INFINITY);
    struct proof p = {.o = o, .before = set(0.0f) - vec_dot(o, d), .lo = none, .hi = none};
    struct vec c = vec_along(o, d, p.before);
    p.square = vec_dot(c, c);
    // A ray along d′, within `spread` of d, is out of the copy's ball by t = bound − o·d′ ≤ bound + before + |o|·spread,
    // and one that meets it has |o| ≤ |before| + bound + spread·t: t ≤ (|before| + bound)/(1 − spread). Bundles go from
    // cell to cell where spread < .05 (together_until): 1.1 is more than 1/.95. It would do up to 1/11.
    p.wide = mul_add(absolute(p.before) + set(bound), set(1.1f * grid->spread), set(grid->slack));
    p.others = none;
    p.shape = p.axis = set(-1.0f);
    p.away = set(0.0f);
    return p;
}

#endif
