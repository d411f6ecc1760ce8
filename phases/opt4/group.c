// Groups of shapes: simd/group_program.h with floats.
#include "trace.h"

// The point of a node's parent in the node's frame.
static struct vec apply_transform(struct vec p, const struct primitive *s) {
    COUNT(apply_transform, call);
    struct vec at = vec_set(s->position);
    p = turned(s, (struct vec){p.x - at.x, p.y - at.y, p.z - at.z});
    return s->repeated ? vec_wrapped(s, p) : p;
}

#include "simd/group_program.h"

static vfloat leaf_distance(struct vec point, const struct primitive *s) {
    struct vec p = apply_transform(point, s);
    switch ((int)s->type) {
    case SHAPE_CAPSULE: return sdf_capsule(p, s);
    case SHAPE_ELLIPSOID: return sdf_ellipsoid(p, s);
    case SHAPE_GYROID: return sdf_gyroid(p, s);
    default: return distance_at(p, s, v_mask_none());
    }
}

vfloat sdf_group(struct vec p, const struct primitive *group) {
    COUNT(sdf_group, call);
    return run(p, group, NULL, NULL) * v_splat(group->group.inv_lipschitz);
}

struct materials group_surface(struct vec p, const struct primitive *group,
                               const struct model *model) {
    struct materials surfaces[MAX_VALUES];
    run(p, group, model->materials, surfaces);
    return surfaces[0];
}

static vfloat group_along(const struct local_ray *ray, vfloat t, const struct primitive *group) {
    COUNT(group_along, call);
    struct vec p = vec_along(ray->origin, ray->direction, t);
    return sdf_group(group->repeated ? vec_wrapped(group, p) : p, group);
}

struct closest closest_group(const struct local_ray *rays, vfloat t, const struct prepared *scene,
                             struct closest least) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *group = &scene->primitives[i];
        if (group->type != SHAPE_GROUP)
            continue;
        COUNT(closest_group, shape);
        vfloat distance = group_along(&rays[i], t, group), index = v_splat(group->index);
        vmask first = v_cmp_lt(index, least.shape); // of equals
        vmask closer = v_or(v_cmp_lt(distance, least.distance),
                            v_and(first, v_cmp_ge(least.distance, distance)));
        least.distance = v_min(distance, least.distance);
        least.shape = v_select(closer, index, least.shape);
    }
    return least;
}
