// What a march of shadow rays needs from the BVH before it starts: end and first entry.
#include "bvh/bvh_lists.h"
#include "bvh/bvh_traversal.h"
#include "shadow/shadow_cone.h"

// Ends the rays behind the sphere that holds all solids: no later term is below 1.
static void end_behind_bvh(struct shadow_rays *r, const struct prepared *scene) {
    const struct bvh *tree = &scene->bvh;
    float q = scene->known.lit_slope;
    vfloat a = v_splat(float_max(1.0f - q * q, 1e-6f)), zero = v_splat(0.0f);
    struct vec v = vec_sub(vec_set(tree->centre), r->point);
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

// Returns the rays that meet the bounding sphere of solid i before their first entry. Rays that start on it
// are left out.
static inline vmask may_enter_sphere(const struct primitive *s, int i,
                                     const struct shadow_rays *r) {
    struct vec v = vec_sub(vec_set(s->position), r->point);
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
}
