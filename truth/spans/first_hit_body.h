// Searches all solids for the first surface on a ray. A repeated solid is searched cell by cell (repetition_body.h).
// Included by ray_spans.c, once in doubles and once in quads.

// The ray in the shape's own frame.
static void FN(to_local)(const struct solid *solid, const struct FN(ray) * ray,
                         struct FN(ray) * local) {
    struct IV moved[3];
    for (int i = 0; i < 3; i++)
        moved[i] = FN(sub)(ray->o[i], FN(point)(solid->shape->position[i]));
    for (int i = 0; i < 3; i++) {
        local->o[i] = solid->rotated ? FN(dot)(solid->FN(rotation)[i], moved) : moved[i];
        local->d[i] = solid->rotated ? FN(dot)(solid->FN(rotation)[i], ray->d) : ray->d[i];
    }
}

// Moves the ray's start to the point nearest to the shape's centre, and returns by how much. The coefficients of the
// equations are then of the shape's size, and their enclosures narrow.
static REAL FN(move_start_near)(struct FN(ray) * ray) {
    struct IV a = FN(norm_sq)(ray->d), b = FN(dot)(ray->o, ray->d);
    REAL s = -FN(mid)(b) / FN(mid)(a);
    if (!(s - s == 0))
        return 0;
    for (int i = 0; i < 3; i++)
        ray->o[i] = FN(add)(ray->o[i], FN(mul)(ray->d[i], (struct IV){s, s}));
    return s;
}

// Finds the spans of the local ray inside of one copy of the shape.
static void FN(copy_spans)(const struct solid *solid, struct FN(ray) ray, struct IV range,
                           struct FN(spans) * spans, long *evals) {
    const struct shape *shape = solid->shape;
    REAL shift = 0;
    spans->count = 0;
    spans->overflow = false;
    ++*evals;
    if (shape->type != SHAPE_PLANE)
        shift = FN(move_start_near)(&ray);
    struct IV by = {shift, shift};
    range = FN(sub)(range, by);
    switch (shape->type) {
    case SHAPE_SPHERE: FN(sphere_spans)(shape, &ray, range, spans); break;
    case SHAPE_PLANE: FN(plane_spans)(shape, &ray, range, spans); break;
    case SHAPE_BOX: FN(box_spans)(shape, &ray, range, spans); break;
    case SHAPE_ROUNDED_BOX: FN(rounded_box_spans)(shape, &ray, range, spans); break;
    case SHAPE_CONE: FN(cone_spans)(shape, &ray, range, spans); break;
    case SHAPE_TORUS: FN(torus_spans)(shape, &ray, range, spans, evals); break;
    case SHAPE_OCTAHEDRON: FN(octahedron_spans)(shape, &ray, range, spans); break;
    case SHAPE_GROUP: FN(group_spans)(solid, &ray, range, spans, evals); break;
    default: break; // a fractal is marched
    }
    for (int i = 0; shift != 0 && i < spans->count; i++) {
        struct FN(span) *span = &spans->at[i];
        if (span->in.lo > -(REAL)INFINITY)
            span->in = FN(add)(span->in, by);
        if (span->out.hi < (REAL)INFINITY)
            span->out = FN(add)(span->out, by);
    }
}

// What the search knows of the ray so far.
struct FN(search) {
    struct FN(first) best; // the nearest sure entry
    REAL rival;            // least s at which the first shape's surface may begin
    int rival_shape;
    REAL second; // the same of any other shape
    REAL doubt;  // least s at which a doubtful span may begin
    bool inside, gave_up;
    struct FN(span) outer; // if inside: the span that holds the ray's start
    int outer_shape;
    struct IV reach;
};

// Notes that from s on it is not certain whether a solid begins.
static void FN(note_doubt)(struct FN(search) * search, REAL s) {
    s = s < 0 ? 0 : s;
    search->doubt = s < search->doubt ? s : search->doubt;
}

// Notes a sure entry into a solid: the nearest becomes the hit, the others its rivals.
static void FN(note_entry)(struct FN(search) * search, int index, const struct FN(span) * span) {
    REAL from = span->in.lo;
    if (index == search->rival_shape || search->rival_shape < 0) {
        if (search->rival_shape < 0 || from < search->rival)
            search->rival = from;
        search->rival_shape = index;
    } else if (from < search->rival) {
        search->second = search->rival;
        search->rival = from;
        search->rival_shape = index;
    } else if (from < search->second)
        search->second = from;
    if (search->best.shape >= 0 && search->best.s.hi <= span->in.hi)
        return;
    search->best = (struct FN(first)){
        .s = span->in, .shape = index, .face = span->in_face, .face_sure = span->in_face_sure};
    memcpy(search->best.cell, span->in_cell, sizeof search->best.cell);
}

// Takes one span of a shape into the search. Returns true if no later span of that shape can matter.
static bool FN(take_span)(struct FN(search) * search, int index, const struct FN(span) * span) {
    if (span->out.hi < 0 || span->in.lo > search->reach.hi)
        return false;
    if (!span->sure || (span->in.lo <= 0 && span->in.hi >= 0) ||
        (span->out.lo <= 0 && span->out.hi >= 0) ||
        (span->in.hi > search->reach.lo && span->in.lo > 0)) {
        FN(note_doubt)(search, span->in.lo);
        return false;
    }
    if (span->in.lo > 0) {
        FN(note_entry)(search, index, span);
        return true;
    }
    if (!search->inside || span->out.lo > search->outer.out.lo) {
        search->outer = *span;
        search->outer_shape = index;
    }
    search->inside = true;
    return false;
}

#include "spans/repetition_body.h"

// Takes all spans of one solid into the search.
static void FN(search_solid)(struct FN(search) * search, const struct solid *solid, int index,
                             const struct FN(ray) * ray, long *evals) {
    struct FN(ray) local;
    if (solid->duplicate || is_fractal(solid->shape->type))
        return;
    FN(to_local)(solid, ray, &local);
    if (solid->repeated) {
        FN(walk_cells)(search, solid, index, &local, evals);
        return;
    }
    struct FN(spans) spans;
    struct IV range = {0, search->reach.hi};
    if (solid->shape->type == SHAPE_GROUP && search->best.shape >= 0 &&
        search->best.s.hi < range.hi)
        range.hi = search->best.s.hi; // what is behind a sure entry does not matter
    FN(copy_spans)(solid, local, range, &spans, evals);
    if (spans.overflow)
        FN(note_doubt)(search, 0);
    for (int i = 0; i < spans.count; i++)
        if (FN(take_span)(search, index, &spans.at[i]))
            break;
}

// For a ray that starts inside: leaves one solid after the other until none holds the point. The hit is there.
static void FN(leave_union)(struct FN(search) * search, const struct solid *solids, int count,
                            const struct FN(ray) * ray, long *evals) {
    struct FN(span) outer = search->outer;
    int owner = search->outer_shape;
    for (int rounds = 0; rounds < 2 * count + 1000; rounds++) {
        if (outer.out.lo > search->reach.hi)
            break;
        // The ray from the exit on: a solid that holds the exit holds the ray further.
        struct FN(ray) rest = *ray;
        REAL from = outer.out.hi;
        for (int i = 0; i < 3; i++)
            rest.o[i] = FN(add)(ray->o[i], FN(mul)(ray->d[i], (struct IV){from, from}));
        struct FN(search) next = {.best = {.shape = -1}, .rival_shape = -1};
        next.doubt = next.rival = next.second = (REAL)INFINITY;
        next.reach = FN(sub)(search->reach, (struct IV){from, from});
        if (next.reach.lo < 0)
            break;
        for (int i = 0; i < count; i++)
            if (i != owner) // its other spans do not touch this one
                FN(search_solid)(&next, &solids[i], i, &rest, evals);
        if (next.doubt <= 0)
            FN(note_doubt)(search, outer.out.lo);
        if (!next.inside || !(next.outer.out.hi > 0))
            break;
        outer = next.outer;
        struct IV back = {from, from};
        outer.in = FN(add)(outer.in, back);
        outer.out = FN(add)(outer.out, back);
        owner = next.outer_shape;
    }
    bool within = outer.out.hi <= search->reach.lo;
    bool beyond = outer.out.lo > search->reach.hi;
    search->best = (struct FN(first)){.s = outer.out,
                                      .shape = beyond ? -1 : owner,
                                      .face = outer.out_face,
                                      .face_sure = outer.out_face_sure,
                                      .inside = true,
                                      .proved = within || beyond};
    memcpy(search->best.cell, outer.out_cell, sizeof search->best.cell);
    if (search->doubt <= outer.out.hi && search->doubt <= search->reach.hi)
        search->best.proved = false;
}

struct FN(first) FN(first_hit)(const struct solid *solids, int count, const struct FN(ray) * ray,
                               struct IV reach, long *evals) {
    struct FN(search) search = {.best = {.shape = -1}, .rival_shape = -1, .reach = reach};
    search.doubt = search.rival = search.second = (REAL)INFINITY;
    if (!(FN(norm_sq)(ray->d).lo > 0) || !(reach.hi - reach.hi == 0)) {
        search.best.s = (struct IV){0, reach.hi};
        return search.best; // the direction may be 0
    }
    for (int i = 0; i < count; i++)
        FN(search_solid)(&search, &solids[i], i, ray, evals);
    if (search.inside) {
        FN(leave_union)(&search, solids, count, ray, evals);
        search.best.gave_up = search.gave_up;
        return search.best;
    }
    struct FN(first) *best = &search.best;
    REAL other = best->shape == search.rival_shape ? search.second : search.rival;
    if (best->shape < 0)
        best->proved = !(search.doubt <= reach.hi);
    else
        best->proved = !(search.doubt <= best->s.hi) && !(other <= best->s.hi);
    if (!best->proved) { // s encloses where the hit may be
        REAL least = search.doubt < search.rival ? search.doubt : search.rival;
        REAL most = best->shape < 0 ? reach.hi : best->s.hi;
        best->s = (struct IV){least < most ? least : most, most};
    }
    search.best.gave_up = search.gave_up;
    return search.best;
}
