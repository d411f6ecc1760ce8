// Shadow rays of a crowd that leave a flat face of a box or an octahedron: h is facing·t there, as of a plane, as long as
// that face is the nearest, so that the first steps can be leapt over as from a plane (shadow/soft_shadow.c).
#ifndef OPT9_FLAT_H
#define OPT9_FLAT_H

#include "bvh/bvh_lists.h"

// How far the face is the nearest of the solid's: a ray from its surface at o, in its frame.
static vfloat flat_distance(const struct primitive *s, struct vec o, struct vec d) {
    COUNT(flat_distance, call);
    vfloat zero = v_splat(0.0f), tiny = v_splat(1e-20f), never = v_splat(INFINITY);
    vfloat x = v_abs(o.x), y = v_abs(o.y), z = v_abs(o.z);
    vfloat dx = v_negate_where(v_signbit(o.x), d.x), dy = v_negate_where(v_signbit(o.y), d.y),
           dz = v_negate_where(v_signbit(o.z), d.z);
    if (s->type == SHAPE_OCTAHEDRON) {
        COUNT(flat_distance, octahedron);
        vfloat third = (x + y + z - v_splat(s->a)) * v_splat(1.0f / 3),
               fall = (dx + dy + dz) * v_splat(1.0f / 3);
        vfloat a = (x - third) / v_max(fall - dx, tiny), b = (y - third) / v_max(fall - dy, tiny),
               c = (z - third) / v_max(fall - dz, tiny);
        return v_min(a, v_min(b, c));
    }
    COUNT(flat_distance, box);
    vfloat off_x = x - v_splat(s->size[0]), off_y = y - v_splat(s->size[1]),
           off_z = z - v_splat(s->size[2]);
    vfloat most = v_max(off_x, v_max(off_y, off_z));
    // It is left where it is gone towards, or behind the other side.
    vfloat a =
        v_select(v_signbit(dx), x + v_splat(s->size[0]), zero - off_x) / v_max(v_abs(dx), tiny);
    vfloat b =
        v_select(v_signbit(dy), y + v_splat(s->size[1]), zero - off_y) / v_max(v_abs(dy), tiny);
    vfloat c =
        v_select(v_signbit(dz), z + v_splat(s->size[2]), zero - off_z) / v_max(v_abs(dz), tiny);
    a = v_select(v_cmp_ge(off_x, most), never, a);
    b = v_select(v_cmp_ge(off_y, most), never, b);
    c = v_select(v_cmp_ge(off_z, most), never, c);
    return v_min(a, v_min(b, c));
}

// Which rays are from such a face; their `alone` is then until when nothing else is nearer to them.
static vmask leaves_flat_face(struct shadow_rays *r, const struct prepared *scene) {
    COUNT(leaves_flat_face, call);
    float shapes[LANES];
    v_store(r->shape, shapes);
    vmask flat = v_mask_none();
    for (unsigned rest = v_mask_bits(r->active); rest;) {
        int i = (int)shapes[__builtin_ctz(rest)];
        vmask own = v_and(v_mask_of_bits(rest), is_shape(r->shape, i));
        const struct primitive *s = &scene->placed[i];
        rest &= ~v_mask_bits(own);
        ACTIVE(v_count(own));
        COUNT(leaves_flat_face, shape);
        if (s->type != SHAPE_BOX && s->type != SHAPE_OCTAHEDRON)
            continue;
        COUNT(leaves_flat_face, solid);
        COUNT(leaves_flat_face, scalar);
        vfloat until = flat_distance(s, r->local, turned(s, r->to_light));
        // Until then |p − position| + h is no more than |o| + t + facing·t.
        float alone =
            scene->more[i].alone * (1 - 1e-5f) - 1e-6f * (float)scene->model.march.bounds_radius;
        vfloat room = v_splat(alone) - vec_norm(r->local);
        until = v_min(until, room / (v_splat(1.0f) + r->facing));
        r->alone = v_select(own, v_min(until, r->alone), r->alone);
        flat = v_or(flat, own);
    }
    return flat;
}

#endif
