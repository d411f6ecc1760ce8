// Groups of shapes: simd/group_program.h with doubles.
#include "trace.h"

#define vec_from_doubles vec_set
#include "simd/group_program.h"

static vdouble leaf_distance(struct vec point, const struct primitive *s) {
    switch ((int)s->type) {
    case SHAPE_CAPSULE: return sdf_capsule(apply_transform(point, s), s);
    case SHAPE_ELLIPSOID: return sdf_ellipsoid(apply_transform(point, s), s);
    case SHAPE_GYROID: return sdf_gyroid(apply_transform(point, s), s);
    default: return distance_to_shape(point, s, v_mask_none());
    }
}

// The field of the group over its Lipschitz constant.
static vdouble sdf_group(struct vec point, const struct primitive *group) {
    COUNT(sdf_group, call);
    vdouble field = run(apply_transform(point, group), group, NULL, NULL);
    return field * v_splat(group->group.inv_lipschitz);
}

struct closest closest_group(struct vec p, const struct prepared *scene, struct closest least) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *group = &scene->primitives[i];
        if (group->type != SHAPE_GROUP)
            continue;
        COUNT(closest_group, shape);
        vdouble distance = sdf_group(p, group), index = v_splat(group->index);
        vmask first = v_cmp_lt(index, least.shape); // of equals
        vmask closer = v_or(v_cmp_lt(distance, least.distance),
                            v_andnot(v_cmp_gt(distance, least.distance), first));
        least.distance = v_min(distance, least.distance);
        least.shape = v_select(closer, index, least.shape);
    }
    return least;
}

struct materials group_surface(struct vec point, const struct primitive *group,
                               const struct model *model) {
    struct materials surfaces[MAX_VALUES];
    run(apply_transform(point, group), group, model->materials, surfaces);
    return surfaces[0];
}
