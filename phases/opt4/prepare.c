// Prepares the scene in the form that the march needs, again whenever it has moved.
#include <math.h>

#include "phase.h"
#include "scene/vector.h"
#include "trace.h"

static void to_floats(const double from[3], float to[3]) {
    for (int i = 0; i < 3; i++)
        to[i] = (float)from[i];
}

// Fills what moves a ray's origin into the shape's frame. A LINEAR plane needs one row only.
static void set_local_frame(struct primitive *p, const struct shape *shape, double rotation[3][3]) {
    bool linear = p->eval == LINEAR;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double *n = shape->plane.normal;
            p->row[i][j] =
                linear ? n[0] * rotation[0][j] + n[1] * rotation[1][j] + n[2] * rotation[2][j]
                       : rotation[i][j];
        }
        p->centre[i] = shape->position[i];
    }
    if (p->eval == POWER) {
        p->radius_sq = shape->sphere.radius * shape->sphere.radius;
        p->sphere.radius_sq = (float)p->radius_sq;
    }
    if (linear) {
        p->offset = shape->plane.offset;
        to_floats(p->row[0], p->normal);
    }
}

// How to evaluate a shape. A sphere wider than the bounds is always nearer than its radius: there its
// power is as exact as a point, and much more exact near the surface. For other spheres a point is
// cheaper, and more exact many radii away. The square of 1e15 still fits a float.
static enum eval_kind eval_kind_of(const struct shape *shape, bool repeated,
                                   const struct limits *limits) {
    if (repeated)
        return AT_POINT;
    if (shape->type == SHAPE_SPHERE && shape->sphere.radius >= limits->bounds_radius &&
        shape->sphere.radius < 1e15)
        return POWER;
    return shape->type == SHAPE_PLANE ? LINEAR : AT_POINT;
}

static void set_mandelbox(const struct shape *shape, struct primitive *p) {
    p->mandelbox.scale = (float)shape->mandelbox.scale;
    p->mandelbox.stretch = (float)fabs(shape->mandelbox.scale);
    p->mandelbox.fold_limit = (float)shape->mandelbox.fold_limit;
    p->mandelbox.inner_sq =
        (float)(shape->mandelbox.minimum_radius * shape->mandelbox.minimum_radius);
    p->mandelbox.outer_sq = (float)(shape->mandelbox.fixed_radius * shape->mandelbox.fixed_radius);
    p->mandelbox.iterations = shape->mandelbox.iterations;
}

// The solids that stand in groups alone.
static void set_group_solid(const struct shape *shape, struct primitive *p) {
    const double *r = shape->ellipsoid.radius;
    if (shape->type == SHAPE_CAPSULE) {
        p->cone.bottom_radius = (float)shape->capsule.radius;
        p->cone.half_height = (float)shape->capsule.half_height;
    } else if (shape->type == SHAPE_ELLIPSOID) {
        p->ellipsoid.least = (float)fmin(r[0], fmin(r[1], r[2]));
        for (int i = 0; i < 3; i++)
            p->ellipsoid.inv_radii[i] = (float)(1.0 / r[i]);
    } else {
        double frequency = 2.0 * M_PI / shape->gyroid.cell;
        p->gyroid.frequency = (float)frequency;
        p->gyroid.scale = (float)(1.0 / (sqrt(3.0) * frequency));
        p->gyroid.half_thickness = (float)(0.5 * shape->gyroid.thickness);
    }
}

static struct primitive make_primitive(int index, const struct shape *shape,
                                       const struct limits *limits) {
    struct primitive p = {.type = shape->type, .index = (float)index};
    double rotation[3][3];
    rotation_matrix(shape->rotation_degrees, rotation);
    for (int i = 0; i < 3; i++) {
        split(shape->position[i], &p.position[i], &p.position_lo[i]);
        to_floats(rotation[i], p.rotation[i]);
        p.rotated = p.rotated || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = (float)shape->repeat[i];
        p.cell_double[i] = shape->repeat[i];
        p.inv_cell_double[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
        p.inv_cell[i] = (float)p.inv_cell_double[i];
    }
    p.eval = eval_kind_of(shape, p.repeated, limits);
    set_local_frame(&p, shape, rotation);
    switch (shape->type) {
    case SHAPE_SPHERE: p.sphere.radius = (float)shape->sphere.radius; break;
    case SHAPE_BOX: to_floats(shape->box.half_size, p.box.half_size); break;
    case SHAPE_ROUNDED_BOX:
        to_floats(shape->box.half_size, p.box.half_size);
        p.box.rounding = (float)shape->box.rounding;
        break;
    case SHAPE_TORUS:
        p.torus.major_radius = (float)shape->torus.major_radius;
        p.torus.minor_radius = (float)shape->torus.minor_radius;
        break;
    case SHAPE_CONE: {
        double across = shape->cone.top_radius - shape->cone.bottom_radius;
        double up = 2.0 * shape->cone.half_height;
        p.cone.bottom_radius = (float)shape->cone.bottom_radius;
        p.cone.top_radius = (float)shape->cone.top_radius;
        p.cone.half_height = (float)shape->cone.half_height;
        p.cone.side[0] = (float)across;
        p.cone.side[1] = (float)up;
        p.cone.inv_side_sq = (float)(1.0 / (across * across + up * up));
        break;
    }
    case SHAPE_OCTAHEDRON: p.octahedron.radius = (float)shape->octahedron.radius; break;
    case SHAPE_PLANE:
        to_floats(shape->plane.normal, p.plane.normal);
        p.plane.offset = (float)shape->plane.offset;
        break;
    case SHAPE_MANDELBOX: set_mandelbox(shape, &p); break;
    case SHAPE_CAPSULE:
    case SHAPE_ELLIPSOID:
    case SHAPE_GYROID: set_group_solid(shape, &p); break;
    case SHAPE_GROUP: break; // group_compile()
    default:
        p.mandelbulb.bailout = (float)shape->mandelbulb.bailout;
        p.mandelbulb.iterations = shape->mandelbulb.iterations;
        break;
    }
    return p;
}

#define PRIMITIVE_OF(shape) make_primitive(0, shape, &model->march)
#include "scene/group_compile.h"

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    struct instruction *next = prepared->instructions;
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        prepared->primitives[i] = make_primitive(i, shape, &model->march);
        if (shape->type != SHAPE_GROUP)
            continue;
        next = group_compile(model, shape->group.root, &prepared->primitives[i], next);
        prepared->primitives[i].group.extent = (float)model->nodes[shape->group.root].radius;
    }
    return true;
}
