// A group's surface at hits: normals and materials. A blend of spheres needs no program.
#include "groups/field.h"

#include "fields/balls.h"
#include "fields/rays.h"
#include "fields/spheres.h"

// Returns the surface that the listed spheres have: normals and materials are mixed by the weights.
__attribute__((always_inline)) static inline struct field_surface
blend_surface(const struct field *field, const int *list, int count, struct vec p) {
    const struct program *program = field->program;
    vfloat e[MOST_SPHERES], zero = v_splat(0.0f), one = v_splat(1.0f), least = v_splat(INFINITY);
    struct vec g[MOST_SPHERES], n = {zero, zero, zero};
    if (count < 1)
        __builtin_unreachable();
    for (int i = 0; i < count; i++) {
        struct vec v = vec_sub(p, ball_centre(field, list[i]));
        vfloat square = v_max(vec_dot(v, v), v_splat(1e-30f)), per = v_rsqrt_newton(square);
        e[i] = v_msub(square, per, v_splat(field->sphere[list[i]])) * v_splat(field->per_blend);
        g[i] = vec_scale(v, per);
        least = v_min(e[i], least);
    }
    vfloat level = one + least;
    if (count > 1 && count < 5) {
        level = level_of_few(e, count, one);
    } else if (count > 4) {
        for (int i = 0; i < count; i++)
            e[i] = e[i] - least;
        level = level_near(e, count);
        vfloat sum = one, kept = zero;
        for (int i = 0; i < count; i++) { // once more, to all bits
            vmask in = v_cmp_lt(e[i], level);
            sum = v_add_where(in, sum, e[i]);
            kept = v_add_where(in, kept, one);
        }
        level = sum / kept;
    }
    struct field_surface all = {n, n, zero, zero};
    for (int i = 0; i < count; i++) {
        int step = field->first[field->balls.shape[list[i]]];
        const struct group_node *m = &program->nodes[program->steps[step].node];
        vfloat w = v_max(level - e[i], zero);
        n = vec_along(n, g[i], w);
        all.color = vec_along(all.color, vec_set(m->color), w);
        all.reflectivity = v_madd(w, v_splat(m->reflectivity), all.reflectivity);
        all.shininess = v_madd(w, v_splat(m->shininess), all.shininess);
    }
    all.normal = vec_scale(n, one / v_max(vec_norm(n), v_splat(1e-18f)));
    return all;
}

// The same; a count that is known has straight-line code.
static struct field_surface listed_surface(const struct field *field, const int *list, int count,
                                           struct vec p) {
    switch (count) {
    case 1: return blend_surface(field, list, 1, p);
    case 2: return blend_surface(field, list, 2, p);
    case 3: return blend_surface(field, list, 3, p);
    case 4: return blend_surface(field, list, 4, p);
    default: return blend_surface(field, list, count, p);
    }
}

enum { MANY_BALLS = 8 };

// Arrays of variable length are aligned as vectors: clang 14 takes the stack below them for aligned so, and passes vectors
// there.
struct field_surface field_surface(const struct field *field, struct vec p, vmask found) {
    _Alignas(64) struct step room[field->program->length];
    _Alignas(64) int list[field->balls.level[0].count + LANES];
    struct program part = *field->program;
    if (field->balls.levels > 0) {
        struct beam b = ball_about(p, found);
        int count = list_balls(field, &b, 0, field->wider, list);
        if (field->blend > 0 && count > MANY_BALLS) { // points far from each other have other balls
            vmask here = points_near(p, found, field->grain), rest = v_andnot(here, found);
            if (v_any(rest)) {
                struct field_surface one = field_surface(field, p, here),
                                     other = field_surface(field, p, rest);
                return (struct field_surface){vec_select(here, one.normal, other.normal),
                                              vec_select(here, one.color, other.color),
                                              v_select(here, one.reflectivity, other.reflectivity),
                                              v_select(here, one.shininess, other.shininess)};
            }
        }
        if (field->blend > 0 && count > 0 && count <= MOST_SPHERES)
            return listed_surface(field, list, count, p);
        if (count > 0)
            part = part_of(field, list, count, room);
    }
    struct field_part at = field_parts(&part, in_group(field, p));
    vfloat size = vec_norm(at.gradient);
    struct vec n = vec_scale(at.gradient, v_splat(1.0f) / v_max(size, v_splat(1e-18f)));
    return (struct field_surface){n, at.color, at.reflectivity, at.shininess};
}
