// Shadow rays of a crowd that leave a flat face of a box or an octahedron: h is facing·t there, as of a plane, as long as
// that face is the nearest, so that the first steps can be leapt over as from a plane (umbra.c).
#ifndef OPT9_FLAT_H
#define OPT9_FLAT_H

#include "crowd.h"

// How far the face is the nearest of the solid's: a ray from its surface at o, in its frame.
static real flat_until(const struct placed *s, struct vec o, struct vec d) {
    COUNT(flat_until, call);
    real zero = set(0.0f), tiny = set(1e-20f), never = set(INFINITY);
    real x = absolute(o.x), y = absolute(o.y), z = absolute(o.z);
    real dx = negate_where(negative(o.x), d.x), dy = negate_where(negative(o.y), d.y),
         dz = negate_where(negative(o.z), d.z);
    if (s->type == SHAPE_OCTAHEDRON) {
        COUNT(flat_until, octahedron);
        real third = (x + y + z - set(s->a)) * set(1.0f / 3), fall = (dx + dy + dz) * set(1.0f / 3);
        real a = (x - third) / most_of(fall - dx, tiny), b = (y - third) / most_of(fall - dy, tiny),
             c = (z - third) / most_of(fall - dz, tiny);
        return least_of(a, least_of(b, c));
    }
    COUNT(flat_until, box);
    real off_x = x - set(s->size[0]), off_y = y - set(s->size[1]), off_z = z - set(s->size[2]);
    real most = most_of(off_x, most_of(off_y, off_z));
    // It is left where it is gone towards, or behind the other side.
    real a = choose(negative(dx), x + set(s->size[0]), zero - off_x) / most_of(absolute(dx), tiny);
    real b = choose(negative(dy), y + set(s->size[1]), zero - off_y) / most_of(absolute(dy), tiny);
    real c = choose(negative(dz), z + set(s->size[2]), zero - off_z) / most_of(absolute(dz), tiny);
    a = choose(not_less(off_x, most), never, a);
    b = choose(not_less(off_y, most), never, b);
    c = choose(not_less(off_z, most), never, c);
    return least_of(a, least_of(b, c));
}

// Which rays are from such a face; their `alone` is then until when nothing else is nearer to them.
static mask on_flat_faces(struct rays *r, const struct prepared *scene) {
    COUNT(on_flat_faces, call);
    float shapes[LANES];
    unload(r->shape, shapes);
    mask flat = no_lane();
    for (unsigned rest = bits(r->active); rest;) {
        int i = (int)shapes[__builtin_ctz(rest)];
        mask own = both(lanes_of(rest), same_shape(r->shape, i));
        const struct placed *s = &scene->placed[i];
        rest &= ~bits(own);
        ACTIVE(count_of(own));
        COUNT(on_flat_faces, shape);
        if (s->type != SHAPE_BOX && s->type != SHAPE_OCTAHEDRON)
            continue;
        COUNT(on_flat_faces, solid);
        COUNT(on_flat_faces, scalar);
        real until = flat_until(s, r->local, turned(s, r->to_light));
        // Until then |p − position| + h is no more than |o| + t + facing·t.
        float alone =
            scene->more[i].alone * (1 - 1e-5f) - 1e-6f * (float)scene->model.march.bounds_radius;
        real room = set(alone) - vec_norm(r->local);
        until = least_of(until, room / (set(1.0f) + r->facing));
        r->alone = choose(own, least_of(until, r->alone), r->alone);
        flat = either(flat, own);
    }
    return flat;
}

#endif
