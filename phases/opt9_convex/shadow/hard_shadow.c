// Hard shadows by closed forms: whether a ray reaches the light.
#include "hit/solids.h"
#include "repetition/repeated_rays.h"
#include "shadow/shadow_rays.h"
#include "types/sdf.h"
#include "types/tile_context.h"

// Hard shadow rays, from where a march would begin to the light or to the bounds.
struct light_segment {
    struct vec point, start, local, to_light;
    vfloat shape, path_length, reach; // reach: path_length and a margin for rounding
};

// Removes from *open the rays that shape i blocks.
INLINE void block_light(int i, const struct light_segment *w, const struct tile_context *work,
                        vmask *open) {
    if (!v_any(*open))
        return;
    const struct known_scene *scene = KNOWN(work->scene);
    const struct primitive *s = &scene->primitives[i];
    vfloat zero = v_splat(0.0f), offset = v_splat((float)scene->model.march.surface_offset);
    vmask self = is_shape(w->shape, i), blocked;
    if (s->eval == EVAL_LINEAR) {
        vfloat slope = add_dot(s->normal, w->to_light), height = height_over(s, w->start);
        blocked = v_andnot(self, v_cmp_lt(v_madd(w->path_length, slope, height), zero));
        blocked = v_or(blocked, v_andnot(self, v_cmp_lt(height, zero)));
    } else if (REPEATED(s)) {
        struct vec from = vec_along(w->local, turned(s, w->to_light), offset);
        from = vec_select(self, from, to_local(s, w->start));
        blocked = cells_occlude(s, from, w->to_light, self, *open, w->reach);
    } else {
        struct vec at, d = turned(s, w->to_light),
                       o = vec_select(self, vec_along(w->local, d, offset), to_local(s, w->start));
        vmask tested = s->convex ? v_andnot(self, *open) : *open;
        vfloat t;
        vmask within;
        blocked = enter(o, d, s, tested, &t, &at, &within);
        blocked = v_and(blocked, v_cmp_lt(t, w->reach));
        if (IS_GROUP(s)) // a ray that begins inside has entered it there
            blocked = v_or(blocked, within);
        else if (!s->convex)
            within = v_and(tested, v_cmp_lt(vec_dot(o, o), v_splat(s->bound_sq)));
        within = v_andnot(blocked, within);
        if (v_any(within)) {
            blocked =
                v_or(blocked, v_and(within, v_cmp_lt(distance_at(o, s, v_mask_none()), zero)));
        }
    }
    *open = v_andnot(v_and(blocked, v_cmp_gt(w->path_length, zero)), *open);
}

vmask reaches_light(struct vec point, struct vec local, struct vec to_light, vfloat shape,
                    vfloat distance, vmask active, const struct tile_context *work) {
    const struct known_model *model = &KNOWN(work->scene)->model;
    vfloat zero = v_splat(0.0f), offset = v_splat((float)model->march.surface_offset),
           hit = v_splat((float)work->scene->model.march.hit_distance);
    float radius = (float)model->march.bounds_radius;
    struct vec start = vec_along(point, to_light, offset);
    vfloat along = vec_dot(start, to_light);
    vfloat leaves =
        v_sqrt(v_max(v_madd(along, along, v_splat(radius * radius) - vec_dot(start, start)), zero));
    vfloat path_length = v_min(distance - offset, leaves - along);
    vfloat reach = v_madd(path_length, v_splat(1.0f + 0x1p-21f), hit);
    struct light_segment w = {point, start, local, to_light, shape, path_length, reach};
    vmask open = active;
    UNROLL_SHAPES
    for (int k = 0; k < set_end(&work->scratch->occluders); k++)
        if (set_has(&work->scratch->occluders, k))
            block_light(set_shape(&work->scratch->occluders, k), &w, work, &open);
    return open;
}
