// A shape in the form that the march needs.
#include "core/primitives.h"

#define PI 3.14159265358979323846

// Sets the sizes of a shape that is only in groups: see groups/field.h.
static void prepare_node_shape(struct primitive *p, const struct shape *shape) {
    const double *radius = shape->ellipsoid.radius;
    if ((int)p->type == SHAPE_CAPSULE) {
        p->a = (float)shape->capsule.radius;
        p->c = (float)shape->capsule.half_height;
    } else if ((int)p->type == SHAPE_ELLIPSOID) {
        for (int i = 0; i < 3; i++)
            p->size[i] = (float)(1 / radius[i]);
        p->a = (float)fmin(radius[0], fmin(radius[1], radius[2]));
    } else {
        p->a = (float)(2 * PI / shape->gyroid.cell);
        p->b = (float)(shape->gyroid.cell / (2 * PI * sqrt(3)));
        p->c = (float)(shape->gyroid.thickness / 2);
    }
}

static void prepare_mandelbox(struct primitive *p, const struct shape *shape) {
    p->a = (float)shape->mandelbox.scale;
    p->b = (float)fabs(shape->mandelbox.scale);
    p->c = (float)shape->mandelbox.fold_limit;
    p->size[0] = (float)(shape->mandelbox.minimum_radius * shape->mandelbox.minimum_radius);
    p->size[1] = (float)(shape->mandelbox.fixed_radius * shape->mandelbox.fixed_radius);
    p->iterations = shape->mandelbox.iterations;
}

struct primitive prepare_shape(int index, const struct shape *shape, const struct limits *limits) {
    struct primitive p = {.type = shape->type, .index = (float)index};
    double turn[3][3];
    rotation_matrix(shape->rotation_degrees, turn);
    for (int i = 0; i < 3; i++) {
        split(shape->position[i], &p.position[i], &p.position_lo[i]);
        to_floats(turn[i], p.turn[i]);
        p.turned = p.turned || shape->rotation_degrees[i] != 0.0;
        p.repeated = p.repeated || shape->repeat[i] > 0.0;
        p.cell[i] = (float)shape->repeat[i];
        p.wide_cell[i] = shape->repeat[i];
        p.wide_per_cell[i] = shape->repeat[i] > 0.0 ? 1.0 / shape->repeat[i] : 0.0;
        p.per_cell[i] = (float)p.wide_per_cell[i];
    }
    p.eval = eval_kind_of(shape, p.repeated, limits);
    prepare_rows(&p, shape, turn);
    switch ((int)shape->type) {
    case SHAPE_SPHERE: p.a = (float)shape->sphere.radius; break;
    case SHAPE_BOX: to_floats(shape->box.half_size, p.size); break;
    case SHAPE_ROUNDED_BOX:
        to_floats(shape->box.half_size, p.size);
        p.a = (float)shape->box.rounding;
        break;
    case SHAPE_TORUS:
        p.a = (float)shape->torus.major_radius;
        p.b = (float)shape->torus.minor_radius;
        break;
    case SHAPE_CONE: {
        double across = shape->cone.top_radius - shape->cone.bottom_radius;
        double up = 2.0 * shape->cone.half_height;
        p.a = (float)shape->cone.bottom_radius;
        p.b = (float)shape->cone.top_radius;
        p.c = (float)shape->cone.half_height;
        p.slope[0] = (float)across;
        p.slope[1] = (float)up;
        p.per_slope_sq = (float)(1.0 / (across * across + up * up));
        break;
    }
    case SHAPE_OCTAHEDRON: p.a = (float)shape->octahedron.radius; break;
    case SHAPE_PLANE:
        to_floats(shape->plane.normal, p.size);
        p.a = (float)shape->plane.offset;
        break;
    case SHAPE_GROUP: p.eval = EVAL_FIELD; break;
    case SHAPE_MANDELBOX: prepare_mandelbox(&p, shape); break;
    case SHAPE_CAPSULE:
    case SHAPE_ELLIPSOID:
    case SHAPE_GYROID: prepare_node_shape(&p, shape); break;
    default:
        p.bailout = (float)shape->mandelbulb.bailout;
        p.iterations = shape->mandelbulb.iterations;
        break;
    }
    p.steady = !p.repeated && !is_fractal(p.type); // of a group: see compile_groups()
    p.slack = 0x1p-18f * extent_of(shape);
    return p;
}
