// The sizes of a shape as the distances of opt2 to opt4 need them. Included by the phase's source: struct primitive is its.
#pragma once

#include <math.h>

#include "scene/scene.h"

// The solids that stand in groups alone.
static void set_group_solid(const struct shape *shape, struct primitive *p) {
    const double *r = shape->ellipsoid.radius;
    if (shape->type == SHAPE_CAPSULE) {
        p->cone.bottom_radius = shape->capsule.radius;
        p->cone.half_height = shape->capsule.half_height;
    } else if (shape->type == SHAPE_ELLIPSOID) {
        p->ellipsoid.least = fmin(r[0], fmin(r[1], r[2]));
        for (int i = 0; i < 3; i++)
            p->ellipsoid.inv_radii[i] = 1.0 / r[i];
    } else {
        double frequency = 2.0 * M_PI / shape->gyroid.cell;
        p->gyroid.frequency = frequency;
        p->gyroid.scale = 1.0 / (sqrt(3.0) * frequency);
        p->gyroid.half_thickness = 0.5 * shape->gyroid.thickness;
    }
}

static void set_cone(const struct shape *shape, struct primitive *p) {
    double across = shape->cone.top_radius - shape->cone.bottom_radius;
    double up = 2.0 * shape->cone.half_height;
    p->cone.bottom_radius = shape->cone.bottom_radius;
    p->cone.top_radius = shape->cone.top_radius;
    p->cone.half_height = shape->cone.half_height;
    p->cone.side[0] = across;
    p->cone.side[1] = up;
    p->cone.inv_side_sq = 1.0 / (across * across + up * up);
}

static void set_mandelbox(const struct shape *shape, struct primitive *p) {
    p->mandelbox.scale = shape->mandelbox.scale;
    p->mandelbox.stretch = fabs(shape->mandelbox.scale);
    p->mandelbox.fold_limit = shape->mandelbox.fold_limit;
    p->mandelbox.inner_sq = shape->mandelbox.minimum_radius * shape->mandelbox.minimum_radius;
    p->mandelbox.outer_sq = shape->mandelbox.fixed_radius * shape->mandelbox.fixed_radius;
    p->mandelbox.iterations = shape->mandelbox.iterations;
}

// Sets the sizes by type; nothing of a group, which group_compile() sets.
static void set_sizes(const struct shape *shape, struct primitive *p) {
    switch (shape->type) {
    case SHAPE_SPHERE: p->sphere.radius = shape->sphere.radius; break;
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX:
        for (int i = 0; i < 3; i++)
            p->box.half_size[i] = shape->box.half_size[i];
        p->box.rounding = shape->box.rounding;
        break;
    case SHAPE_TORUS:
        p->torus.major_radius = shape->torus.major_radius;
        p->torus.minor_radius = shape->torus.minor_radius;
        break;
    case SHAPE_CONE: set_cone(shape, p); break;
    case SHAPE_OCTAHEDRON: p->octahedron.radius = shape->octahedron.radius; break;
    case SHAPE_PLANE:
        for (int i = 0; i < 3; i++)
            p->plane.normal[i] = shape->plane.normal[i];
        p->plane.offset = shape->plane.offset;
        break;
    case SHAPE_MANDELBOX: set_mandelbox(shape, p); break;
    case SHAPE_CAPSULE:
    case SHAPE_ELLIPSOID:
    case SHAPE_GYROID: set_group_solid(shape, p); break;
    case SHAPE_GROUP: break;
    default:
        p->mandelbulb.bailout = shape->mandelbulb.bailout;
        p->mandelbulb.iterations = shape->mandelbulb.iterations;
        break;
    }
}
