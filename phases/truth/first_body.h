// A ray against all shapes: into each one's frame, through the cells that it is repeated in, and which
// surface comes first. Included by solve.c twice.

static void FN(localize)(const struct solid *solid, const struct FN(ray) * ray,
                         struct FN(ray) * local) {
    struct IV moved[3];
    for (int i = 0; i < 3; i++)
        moved[i] = FN(sub)(ray->o[i], FN(point)(solid->shape->position[i]));
    for (int i = 0; i < 3; i++) {
        local->o[i] = solid->turned ? FN(dot)(solid->FN(turn)[i], moved) : moved[i];
        local->d[i] = solid->turned ? FN(dot)(solid->FN(turn)[i], ray->d) : ray->d[i];
    }
}

// The ray's start moved to where it is nearest to the shape's centre, so that coefficients are of the
// shape's size; returns by how much.
static REAL FN(move_near)(struct FN(ray) * ray) {
    struct IV a = FN(square)(ray->d), b = FN(dot)(ray->o, ray->d);
    REAL s = -FN(mid)(b) / FN(mid)(a);
    if (!(s - s == 0))
        return 0;
    for (int i = 0; i < 3; i++)
        ray->o[i] = FN(add)(ray->o[i], FN(mul)(ray->d[i], (struct IV){s, s}));
    return s;
}

// Parts of the local ray inside of one copy of the shape.
static void FN(in_copy)(const struct shape *shape, struct FN(ray) ray, struct IV range,
                        struct FN(parts) * parts, long *evals) {
    REAL shift = 0;
    parts->count = 0;
    parts->lost = false;
    ++*evals;
    if (shape->type != SHAPE_PLANE)
        shift = FN(move_near)(&ray);
    struct IV by = {shift, shift};
    range = FN(sub)(range, by);
    switch (shape->type) {
    case SHAPE_SPHERE: FN(in_sphere)(shape, &ray, range, parts); break;
    case SHAPE_PLANE: FN(in_plane)(shape, &ray, range, parts); break;
    case SHAPE_BOX: FN(in_box)(shape, &ray, range, parts); break;
    case SHAPE_ROUNDED_BOX: FN(in_rounded_box)(shape, &ray, range, parts); break;
    case SHAPE_CONE: FN(in_cone)(shape, &ray, range, parts); break;
    case SHAPE_TORUS: FN(in_torus)(shape, &ray, range, parts, evals); break;
    case SHAPE_OCTAHEDRON: FN(in_octahedron)(shape, &ray, range, parts); break;
    default: break; // a Mandelbulb is marched, not solved
    }
    for (int i = 0; shift != 0 && i < parts->count; i++) {
        struct FN(part) *part = &parts->at[i];
        if (part->in.lo > -(REAL)INFINITY)
            part->in = FN(add)(part->in, by);
        if (part->out.hi < (REAL)INFINITY)
            part->out = FN(add)(part->out, by);
    }
}

// What has been seen so far along the ray.
struct FN(search) {
    struct FN(first) best; // the nearest sure entry
    REAL rival;            // least s at which another shape, or a doubtful part, may begin
    int rival_shape;
    REAL second; // the same of the next shape
    REAL doubt;  // least s at which something doubtful may begin
    bool inside, worn;
    struct FN(part) around; // if inside: the part that holds the start
    int around_shape;
    struct IV reach;
};

static void FN(doubtful)(struct FN(search) * search, REAL s) {
    s = s < 0 ? 0 : s;
    search->doubt = s < search->doubt ? s : search->doubt;
}

static void FN(candidate)(struct FN(search) * search, int index, const struct FN(part) * part) {
    REAL from = part->in.lo;
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
    if (search->best.shape >= 0 && search->best.s.hi <= part->in.hi)
        return;
    search->best = (struct FN(first)){
        .s = part->in, .shape = index, .face = part->in_face, .face_sure = part->in_face_sure};
    memcpy(search->best.cell, part->in_cell, sizeof search->best.cell);
}

// One part of one shape. True: no later part of this shape can matter.
static bool FN(consider)(struct FN(search) * search, int index, const struct FN(part) * part) {
    if (part->out.hi < 0 || part->in.lo > search->reach.hi)
        return false;
    if (!part->sure || (part->in.lo <= 0 && part->in.hi >= 0) ||
        (part->out.lo <= 0 && part->out.hi >= 0) ||
        (part->in.hi > search->reach.lo && part->in.lo > 0)) {
        FN(doubtful)(search, part->in.lo);
        return false;
    }
    if (part->in.lo > 0) {
        FN(candidate)(search, index, part);
        return true;
    }
    if (!search->inside || part->out.lo > search->around.out.lo) {
        search->around = *part;
        search->around_shape = index;
    }
    search->inside = true;
    return false;
}

#include "cells_body.h"

static void FN(against)(struct FN(search) * search, const struct solid *solid, int index,
                        const struct FN(ray) * ray, long *evals) {
    struct FN(ray) local;
    if (solid->copy || solid->shape->type == SHAPE_MANDELBULB)
        return;
    FN(localize)(solid, ray, &local);
    if (solid->repeated) {
        FN(through_cells)(search, solid, index, &local, evals);
        return;
    }
    struct FN(parts) parts;
    struct IV range = {0, search->reach.hi};
    FN(in_copy)(solid->shape, local, range, &parts, evals);
    if (parts.lost)
        FN(doubtful)(search, 0);
    for (int i = 0; i < parts.count; i++)
        if (FN(consider)(search, index, &parts.at[i]))
            break;
}

// The ray starts inside: out of one shape after the other, until none holds it.
static void FN(go_out)(struct FN(search) * search, const struct solid *solids, int count,
                       const struct FN(ray) * ray, long *evals) {
    struct FN(part) around = search->around;
    int owner = search->around_shape;
    for (int rounds = 0; rounds < 2 * count + 1000; rounds++) {
        if (around.out.lo > search->reach.hi)
            break;
        // The ray from there on: what holds that place holds it on.
        struct FN(ray) rest = *ray;
        REAL from = around.out.hi;
        for (int i = 0; i < 3; i++)
            rest.o[i] = FN(add)(ray->o[i], FN(mul)(ray->d[i], (struct IV){from, from}));
        struct FN(search) next = {.best = {.shape = -1}, .rival_shape = -1};
        next.doubt = next.rival = next.second = (REAL)INFINITY;
        next.reach = FN(sub)(search->reach, (struct IV){from, from});
        if (next.reach.lo < 0)
            break;
        for (int i = 0; i < count; i++)
            if (i != owner) // its other parts do not touch this one
                FN(against)(&next, &solids[i], i, &rest, evals);
        if (next.doubt <= 0)
            FN(doubtful)(search, around.out.lo);
        if (!next.inside || !(next.around.out.hi > 0))
            break;
        around = next.around;
        struct IV back = {from, from};
        around.in = FN(add)(around.in, back);
        around.out = FN(add)(around.out, back);
        owner = next.around_shape;
    }
    bool within = around.out.hi <= search->reach.lo;
    bool beyond = around.out.lo > search->reach.hi;
    search->best = (struct FN(first)){.s = around.out,
                                      .shape = beyond ? -1 : owner,
                                      .face = around.out_face,
                                      .face_sure = around.out_face_sure,
                                      .inside = true,
                                      .proved = within || beyond};
    memcpy(search->best.cell, around.out_cell, sizeof search->best.cell);
    if (search->doubt <= around.out.hi && search->doubt <= search->reach.hi)
        search->best.proved = false;
}

struct FN(first) FN(first_hit)(const struct solid *solids, int count, const struct FN(ray) * ray,
                               struct IV reach, long *evals) {
    struct FN(search) search = {.best = {.shape = -1}, .rival_shape = -1, .reach = reach};
    search.doubt = search.rival = search.second = (REAL)INFINITY;
    if (!(FN(square)(ray->d).lo > 0) || !(reach.hi - reach.hi == 0)) {
        search.best.s = (struct IV){0, reach.hi};
        return search.best; // no direction
    }
    for (int i = 0; i < count; i++)
        FN(against)(&search, &solids[i], i, ray, evals);
    if (search.inside) {
        FN(go_out)(&search, solids, count, ray, evals);
        search.best.worn = search.worn;
        return search.best;
    }
    struct FN(first) *best = &search.best;
    REAL other = best->shape == search.rival_shape ? search.second : search.rival;
    if (best->shape < 0)
        best->proved = !(search.doubt <= reach.hi);
    else
        best->proved = !(search.doubt <= best->s.hi) && !(other <= best->s.hi);
    if (!best->proved) { // where it may be
        REAL least = search.doubt < search.rival ? search.doubt : search.rival;
        REAL most = best->shape < 0 ? reach.hi : best->s.hi;
        best->s = (struct IV){least < most ? least : most, most};
    }
    search.best.worn = search.worn;
    return search.best;
}
