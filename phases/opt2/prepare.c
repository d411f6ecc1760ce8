// Prepares the scene in the form that the march needs, again whenever it has moved.
#include <string.h>

#include "phase.h"
#include "scene/vector.h"
#include "trace.h"

// The solids that stand in groups alone.
static void set_group_solid(const struct shape *shape, struct primitive *p) {
    const double *r = shape->ellipsoid.radius;
    if (shape->type == SHAPE_CAPSULE) {
        p->cone.bottom_radius = shape->capsule.radius;
        p->cone.half_height = shape->capsule.half_height;
    } else if (shape->type == SHAPE_ELLIPSOID) {
        p->ellipsoid.least = min_of(r[0], min_of(r[1], r[2]));
        for (int i = 0; i < 3; i++)
            p->ellipsoid.inv_radii[i] = 1.0 / r[i];
    } else {
        p->gyroid.frequency = 2.0 * M_PI / shape->gyroid.cell;
        p->gyroid.scale = 1.0 / (sqrt(3.0) * p->gyroid.frequency);
        p->gyroid.half_thickness = 0.5 * shape->gyroid.thickness;
    }
}

static struct primitive make_primitive(const struct shape *shape) {
    struct primitive p = {.type = shape->type};
    vec_set(shape->position, p.position);
    rotation_matrix(shape->rotation_degrees, p.rotation);
    for (int i = 0; i < 3; i++) {
        p.rotated = p.rotated || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = shape->repeat[i];
        p.inv_cell[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
    }
    switch (shape->type) {
    case SHAPE_SPHERE: p.sphere.radius = shape->sphere.radius; break;
    case SHAPE_BOX: vec_set(shape->box.half_size, p.box.half_size); break;
    case SHAPE_TORUS:
        p.torus.major_radius = shape->torus.major_radius;
        p.torus.minor_radius = shape->torus.minor_radius;
        break;
    case SHAPE_ROUNDED_BOX:
        memcpy(p.box.half_size, shape->box.half_size, sizeof shape->box.half_size);
        p.box.rounding = shape->box.rounding;
        break;
    case SHAPE_CONE:
        p.cone.bottom_radius = shape->cone.bottom_radius;
        p.cone.top_radius = shape->cone.top_radius;
        p.cone.half_height = shape->cone.half_height;
        p.cone.side[0] = p.cone.top_radius - p.cone.bottom_radius;
        p.cone.side[1] = 2.0 * p.cone.half_height;
        p.cone.inv_side_sq =
            1.0 / (p.cone.side[0] * p.cone.side[0] + p.cone.side[1] * p.cone.side[1]);
        break;
    case SHAPE_OCTAHEDRON: p.octahedron.radius = shape->octahedron.radius; break;
    case SHAPE_PLANE:
        vec_set(shape->plane.normal, p.plane.normal);
        p.plane.offset = shape->plane.offset;
        break;
    case SHAPE_MANDELBOX:
        p.mandelbox.scale = shape->mandelbox.scale;
        p.mandelbox.fold_limit = shape->mandelbox.fold_limit;
        p.mandelbox.inner_sq = shape->mandelbox.minimum_radius * shape->mandelbox.minimum_radius;
        p.mandelbox.outer_sq = shape->mandelbox.fixed_radius * shape->mandelbox.fixed_radius;
        p.mandelbox.iterations = shape->mandelbox.iterations;
        break;
    case SHAPE_CAPSULE:
    case SHAPE_ELLIPSOID:
    case SHAPE_GYROID: set_group_solid(shape, &p); break;
    case SHAPE_GROUP: break; // group_compile()
    default:
        p.mandelbulb.bailout = shape->mandelbulb.bailout;
        p.mandelbulb.iterations = shape->mandelbulb.iterations;
        break;
    }
    return p;
}

#define PRIMITIVE_OF(shape) make_primitive(shape)
#include "scene/group_compile.h"

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    prepared->bounds_sq = model->march.bounds_radius * model->march.bounds_radius;
    struct instruction *next = prepared->instructions;
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        prepared->primitives[i] = make_primitive(shape);
        if (shape->type == SHAPE_GROUP)
            next = group_compile(model, shape->group.root, &prepared->primitives[i], next);
    }
    return true;
}
