// Points and rays in the frames of shapes, and the distance of a shape.
//
// In float, a point at |p| = 20 is known to 1e-6, the scene's hit distance. So nothing is evaluated in world
// coordinates. Each ray has an origin and a direction in the frame of each shape, and the march evaluates
// origin + t·direction there, rounded once at the size of the shape. Branches that differ between lanes are
// evaluated for all lanes and selected by mask.
#pragma once

#include "simd/simd.h"

#include "core/shape_distances.h"
#include "fields/rays.h"
#include "types/known_scene.h"

// Returns a·v. A kernel may know that a is (0, 1, 0); products with 0 could change the sign of a zero only.
static inline vfloat add_dot(const float a[3], struct vec v) {
    if (axis_is_up(a))
        return v.y;
    return vec_dot(vec_set(a), v);
}

// Returns v mirrored at the plane through 0 with unit normal a.
INLINE struct vec reflected_at(const float a[3], struct vec v) {
    if (axis_is_up(a))
        return (struct vec){v.x, v_splat(0.0f) - v.y, v.z};
    return vec_reflect(v, vec_set(a));
}

// Returns the point p in the shape's frame, in float.
INLINE struct vec to_local(const struct primitive *s, struct vec p) {
    return turned(s, vec_sub(p, vec_set(s->position)));
}

// Returns the height of p over a linear plane.
INLINE vfloat height_over(const struct primitive *s, struct vec p) {
    return add_dot(s->normal, p) - v_splat(s->c);
}

// Returns the distance at a point in the shape's frame, already wrapped if the shape is repeated.
__attribute__((always_inline)) static inline vfloat
distance_at(struct vec p, const struct primitive *s, vmask done) {
    if (IS_GROUP(s))
        return field_distance(FIELD_OF(s), p);
    return distance_of_type(p, s, s->type, v_not(done));
}
