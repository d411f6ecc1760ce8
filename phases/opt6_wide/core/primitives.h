// How shapes are prepared: core/prepare_shape.c, and the frames and sizes it uses.
#pragma once

#include "core/prepared.h"
#include "scene/vector.h"

// Returns a shape in the form that the march needs. `index` is its number in the scene.
struct primitive prepare_shape(int index, const struct shape *shape, const struct limits *limits);

// Lists the prepared shapes in prepared->all.
void list_shapes(struct prepared *prepared);

// Memory for as many shapes as the model has. Returns false if it is short. shapes_release() frees it in any case.
bool shapes_reserve(struct prepared *prepared, const struct model *model);
void shapes_release(struct prepared *prepared);

// Sets the members in double: see struct primitive. A plane that is not repeated has one row.
static inline void prepare_rows(struct primitive *p, const struct shape *shape, double turn[3][3]) {
    bool linear = p->eval == EVAL_LINEAR;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double *n = shape->plane.normal;
            p->row[i][j] =
                linear ? n[0] * turn[0][j] + n[1] * turn[1][j] + n[2] * turn[2][j] : turn[i][j];
        }
        p->centre[i] = shape->position[i];
    }
    if (p->eval == EVAL_POWER) {
        p->radius_sq = shape->sphere.radius * shape->sphere.radius;
        p->b = (float)p->radius_sq;
    }
    if (linear) {
        p->offset = shape->plane.offset;
        to_floats(p->row[0], p->normal);
    }
}

// Returns the distance from a shape's centre to its furthest point; 0 for a plane.
static inline float extent_of(const struct shape *shape) {
    const double *half = shape->box.half_size;
    switch ((int)shape->type) {
    case SHAPE_SPHERE: return (float)shape->sphere.radius;
    case SHAPE_BOX: return (float)hypot(hypot(half[0], half[1]), half[2]);
    case SHAPE_ROUNDED_BOX:
        return (float)(hypot(hypot(half[0], half[1]), half[2]) + shape->box.rounding);
    case SHAPE_TORUS: return (float)(shape->torus.major_radius + shape->torus.minor_radius);
    case SHAPE_CONE:
        return (float)hypot(fmax(shape->cone.bottom_radius, shape->cone.top_radius),
                            shape->cone.half_height);
    case SHAPE_OCTAHEDRON: return (float)shape->octahedron.radius;
    case SHAPE_CAPSULE: return (float)(shape->capsule.radius + shape->capsule.half_height);
    case SHAPE_ELLIPSOID:
        half = shape->ellipsoid.radius;
        return (float)fmax(half[0], fmax(half[1], half[2]));
    default: return 0.0f;
    }
}
