// What a march of shadow rays needs from the BVH before it starts: end, first entry and leap limit.
#include "bvh/bvh_lists.h"
#include "bvh/bvh_traversal.h"
#include "shadow/shadow_cone.h"

// Returns the t up to which the face at o is the nearest of solid s. o, d: the rays in its frame, o on its
// surface.
static vfloat flat_distance(const struct primitive *s, struct vec o, struct vec d) {
    vfloat zero = v_splat(0.0f), tiny = v_splat(1e-20f), never = v_splat(INFINITY);
    vfloat x = v_abs(o.x), y = v_abs(o.y), z = v_abs(o.z);
    vfloat dx = v_negate_where(v_signbit(o.x), d.x), dy = v_negate_where(v_signbit(o.y), d.y),
           dz = v_negate_where(v_signbit(o.z), d.z);
    if (s->type == SHAPE_OCTAHEDRON) {
        vfloat third = (x + y + z - v_splat(s->a)) * v_splat(1.0f / 3),
               fall = (dx + dy + dz) * v_splat(1.0f / 3);
        vfloat a = (x - third) / v_max(fall - dx, tiny), b = (y - third) / v_max(fall - dy, tiny),
               c = (z - third) / v_max(fall - dz, tiny);
        return v_min(a, v_min(b, c));
    }
    vfloat off_x = x - v_splat(s->size[0]), off_y = y - v_splat(s->size[1]),
           off_z = z - v_splat(s->size[2]);
    vfloat most = v_max(off_x, v_max(off_y, off_z));
    // The ray passes the neighbouring face, or the one opposite.
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

// Returns the rays that start on a flat face of a box or octahedron. There h is facing·t, as over a plane,
// while that face is nearest. Sets their leap limit.
static vmask leaves_flat_face(struct shadow_rays *r, const struct prepared *scene) {
    float shapes[LANES];
    v_store(r->shape, shapes);
    vmask flat = v_mask_none();
    for (unsigned rest = v_mask_bits(r->active); rest;) {
        int i = (int)shapes[__builtin_ctz(rest)];
        vmask self = v_and(v_mask_of_bits(rest), is_shape(r->shape, i));
        const struct primitive *s = &scene->primitives[i];
        rest &= ~v_mask_bits(self);
        if (s->type != SHAPE_BOX && s->type != SHAPE_OCTAHEDRON)
            continue;
        vfloat until = flat_distance(s, r->local, turned(s, r->to_light));
        // Until then |p − position| + h ≤ |o| + t + facing·t.
        float clearance = scene->extras[i].clearance * (1 - 1e-5f) -
                          1e-6f * (float)scene->model.march.bounds_radius;
        vfloat room = v_splat(clearance) - vec_norm(r->local);
        until = v_min(until, room / (v_splat(1.0f) + r->facing));
        r->leap_limit = v_select(self, v_min(until, r->leap_limit), r->leap_limit);
        flat = v_or(flat, self);
    }
    return flat;
}

// Ends the rays behind the sphere that holds all solids: no later term is below 1.
static void end_behind_bvh(struct shadow_rays *r, const struct prepared *scene) {
    const struct bvh *tree = &scene->bvh;
    float q = scene->known.lit_slope;
    vfloat a = v_splat(float_max(1.0f - q * q, 1e-6f)), zero = v_splat(0.0f);
    struct vec v = {v_splat(tree->centre[0]) - r->point.x, v_splat(tree->centre[1]) - r->point.y,
                    v_splat(tree->centre[2]) - r->point.z};
    vfloat b = vec_dot(v, r->to_light) + v_splat(q * tree->radius);
    vfloat c = vec_dot(v, v) - v_splat(tree->radius * tree->radius * (1 + 1e-5f));
    vfloat discriminant = v_msub(b, b, a * c);
    vmask met = v_or(v_cmp_lt(c, zero), v_and(v_cmp_gt(b, zero), v_cmp_ge(discriminant, zero)));
    vfloat leaves = (b + v_sqrt(v_max(discriminant, zero))) / a;
    if (!(q < 1.0f)) { // as in cone_exit()
        met = v_mask_all();
        leaves = v_splat(INFINITY);
    }
    r->end = v_select(met, v_max(leaves, r->end), r->end);
}

// Lowers the leap limit of rays from planes: the first t at which another shape can be as near as their
// plane.
struct leap_query {
    struct shadow_rays *rays;
    vmask able;
    const struct prepared *scene;
};

static inline vfloat earliest_approach(const float centre[3], float radius,
                                       const struct shadow_rays *r) {
    struct vec v = {v_splat(centre[0]) - r->point.x, v_splat(centre[1]) - r->point.y,
                    v_splat(centre[2]) - r->point.z};
    vfloat zero = v_splat(0.0f), square = vec_dot(v, v), facing = r->facing;
    vfloat c = v_msub(square, v_splat(1 - 2e-6f), v_splat(radius * radius * (1 + 1e-5f)));
    vfloat b = v_madd(facing, v_splat(radius), vec_dot(v, r->to_light)),
           a = v_nmadd(facing, facing, v_splat(1.0f));
    vfloat discriminant = v_msub(b, b, a * c);
    vfloat meets = c / (b + v_sqrt(v_max(discriminant, zero)));
    meets =
        v_select(v_and(v_cmp_gt(b, zero), v_cmp_ge(discriminant, zero)), meets, v_splat(INFINITY));
    return v_select(v_cmp_gt(c, zero), meets, zero);
}

static inline bool sphere_limits_leap(const float centre[3], float radius, void *with) {
    struct leap_query *l = with;
    return v_any(
        v_and(l->able, v_cmp_lt(earliest_approach(centre, radius, l->rays), l->rays->leap_limit)));
}

static inline void limit_leap(int shape, void *with) {
    struct leap_query *l = with;
    const struct primitive *s = &l->scene->primitives[shape];
    struct shadow_rays *r = l->rays;
    r->leap_limit = v_min(r->leap_limit, earliest_approach(s->position, s->bound, r));
}

// Returns the rays that meet the bounding sphere of solid i before their first entry. Rays that start on it
// are left out.
static inline vmask may_enter_sphere(const struct primitive *s, int i,
                                     const struct shadow_rays *r) {
    struct vec v = {v_splat(s->position[0]) - r->point.x, v_splat(s->position[1]) - r->point.y,
                    v_splat(s->position[2]) - r->point.z};
    vfloat along = vec_dot(v, r->to_light), square = vec_dot(v, v);
    vfloat c = v_msub(square, v_splat(1 - 2e-6f), v_splat(s->bound * s->bound * (1 + 1e-5f)));
    vmask ahead = v_and(v_cmp_gt(along, v_splat(0.0f)), v_cmp_ge(along * along, c));
    ahead = v_and(ahead,
                  v_cmp_lt(along - v_splat(s->bound * (1 + 1e-4f)), r->first * v_splat(1 + 1e-5f)));
    vmask may = v_or(ahead, v_cmp_lt(c, v_splat(0.0f)));
    return v_andnot(is_shape(r->shape, i), v_and(r->active, may));
}

void bvh_first_entry(struct shadow_rays *r, struct shadow_candidate *candidates,
                     const struct tile_context *work) {
    const struct prepared *scene = work->scene;
    for (int k = 0; k < scene->plane_count; k++)
        r->on_plane = v_or(r->on_plane, is_shape(r->shape, scene->planes[k]));
    for (int k = 0; k < scene->plane_count; k++)
        candidate_plane(&scene->primitives[scene->planes[k]], scene->planes[k], r, work,
                        &candidates[scene->planes[k]]);
    end_behind_bvh(r, scene);
    for (int k = 0; k < work->scratch->entries; k++) {
        int i = work->scratch->entry_list[k];
        vmask may = may_enter_sphere(&scene->primitives[i], i, r);
        if (!v_any(may))
            continue;
        first_entry(&scene->primitives[i], i, r, may);
    }
    // earliest_approach() needs a slope below 1.
    struct leap_query l = {
        r, v_and(v_and(r->on_plane, r->active), v_cmp_lt(r->facing, v_splat(0.99f))), scene};
    vmask flat = leaves_flat_face(r, scene);
    r->leap_limit = v_select(v_or(l.able, flat), r->leap_limit, v_splat(0.0f));
    r->on_plane = v_or(r->on_plane, flat); // they leap as rays from a plane do
    if (v_any(l.able))
        bvh_visit(&scene->bvh, sphere_limits_leap, limit_leap, &l);
}
