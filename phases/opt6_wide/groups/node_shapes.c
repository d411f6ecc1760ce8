// Distances of the shapes of groups, for several packets: their type is switched on once for all of them.
#include "groups/field.h"

// The distances of one type of shape. `type` is a constant.
__attribute__((always_inline)) static inline void
distances_of_type(const struct step *step, const struct primitive *s, enum shape_type type,
                  const struct vec *at, int count, vfloat *distance) {
    for (int k = 0; k < count; k++) {
        COUNT(group_shape, call);
        distance[k] = node_distance(step->first ? at[k] : in_frame(at[k], s), s, type);
    }
}

void shape_distances(const struct step *step, const struct group_node *n, const struct vec *at,
                     int count, vfloat *distance) {
    const struct primitive *s = &n->shape;
#define CASE(type)                                                                                 \
    case type: distances_of_type(step, s, type, at, count, distance); break;
    switch ((int)s->type) {
        CASE(SHAPE_BOX)
        CASE(SHAPE_TORUS)
        CASE(SHAPE_CONE)
        CASE(SHAPE_OCTAHEDRON)
        CASE(SHAPE_PLANE)
        CASE(SHAPE_ROUNDED_BOX)
        CASE(SHAPE_CAPSULE)
        CASE(SHAPE_ELLIPSOID)
        CASE(SHAPE_GYROID)
    default: distances_of_type(step, s, SHAPE_SPHERE, at, count, distance); break;
    }
#undef CASE
}

void enter_node(const struct group_node *n, const struct vec *p, struct vec *inside) {
    *inside = point_in(*p, n).r;
}

vfloat leave_node(const struct group_node *n, const struct vec *p, vfloat f) {
    return shelled(displaced(f, point_in(*p, n), n), n);
}
