// Warnings: what a scene file may say, but the renderers of this project draw wrong or not at all (scenes/README.md).
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "driver/driver.h"
#include "scene/vector.h"

// Returns the smallest length of a solid or fractal, +inf for a plane.
static double solid_size(const struct shape *s) {
    const double *half = s->box.half_size, *radius = s->ellipsoid.radius;
    switch ((int)s->type) {
    case SHAPE_SPHERE: return s->sphere.radius;
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX: return fmin(half[0], fmin(half[1], half[2])) + s->box.rounding;
    case SHAPE_TORUS: return s->torus.minor_radius;
    case SHAPE_CONE:
        return fmin(fmax(s->cone.bottom_radius, s->cone.top_radius), s->cone.half_height);
    case SHAPE_OCTAHEDRON: return s->octahedron.radius / sqrt(3); // to a face
    case SHAPE_MANDELBULB: return 1;
    case SHAPE_MANDELBOX: return s->mandelbox.fold_limit;
    case SHAPE_CAPSULE: return s->capsule.radius;
    case SHAPE_ELLIPSOID: return fmin(radius[0], fmin(radius[1], radius[2]));
    case SHAPE_GYROID: return s->gyroid.thickness;
    default: return INFINITY;
    }
}

// Returns the smallest length of a shape, of a group that of its solids and shells.
static double size_of(const struct model *model, const struct shape *shape) {
    double size = INFINITY;
    if (shape->type != SHAPE_GROUP)
        return solid_size(shape);
    for (int i = shape->group.root; i < model->nodes[shape->group.root].end; i++) {
        const struct node *node = &model->nodes[i];
        size = fmin(size, node->operation == NODE_SHAPE ? solid_size(&node->shape) : INFINITY);
        size = fmin(size, node->shell > 0 ? 2 * node->shell : INFINITY);
    }
    return size;
}

// A march ends where the distance is below hit_distance: in front of a smaller shape it ends far from it.
static void warn_of_hit_distance(const struct model *model) {
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        if (size_of(model, shape) < model->march.hit_distance) {
            fprintf(stderr,
                    "render: warning: $.march.hit_distance: %g is more than the size of "
                    "$.shapes[%d] (%s, "
                    "%g), which is drawn too large\n",
                    model->march.hit_distance, i, shape_type_name(shape->type),
                    size_of(model, shape));
            return;
        }
    }
}

// Returns the largest coordinate of a shape's place as seen from `from`; of a plane, how far it is away.
static double away(const struct shape *shape, const double from[3]) {
    const double *at = shape->position, *normal = shape->plane.normal;
    double d[3] = {at[0] - from[0], at[1] - from[1], at[2] - from[2]};
    if (shape->type == SHAPE_PLANE)
        return fabs(normal[0] * d[0] + normal[1] * d[1] + normal[2] * d[2] + shape->plane.offset);
    return fmax(fabs(d[0]), fmax(fabs(d[1]), fabs(d[2])));
}

// Numbers at x are `ulp`·x apart. Secondary rays, which start surface_offset off a surface, start within it where that
// is less; and a shape that is smaller has no place. Returns whether it warns of this shape.
static bool warn_of_coordinates(const struct session *s, int index, double ulp) {
    const struct model *model = &s->scene.model;
    const struct shape *shape = &model->shapes[index];
    const double *camera = s->scene.view.position, zero[3] = {0};
    double seen = model->march.bounds_radius + sqrt(dot3(camera, camera));
    double far = fmin(away(shape, camera), seen), at = away(shape, zero);
    const char *numbers = s->program.precision, *name = shape_type_name(shape->type);
    if (far * ulp > model->march.surface_offset)
        fprintf(stderr,
                "render: warning: $.shapes[%d] (%s) is %g away from the camera, where the %ss of "
                "%s are %.2g apart: $.march.surface_offset should be more than that\n",
                index, name, far, numbers, s->program.phase, far * ulp);
    else if (at * ulp > size_of(model, shape) / 2)
        fprintf(stderr,
                "render: warning: $.shapes[%d] (%s, %g) is at %g, where the %ss of %s are %.2g "
                "apart: the scene should be nearer to 0\n",
                index, name, size_of(model, shape), at, numbers, s->program.phase, at * ulp);
    else
        return false;
    return true;
}

// Asked of the phase itself, which knows the shapes where an animation begins.
static void warn_of_camera(const struct session *s) {
    struct view view;
    double distance;
    int nearest;
    bool moved = s->scene.model.animated && s->options.first_frame > 0;
    if (moved || scene_view(&s->scene, s->options.first_frame / 60.0, &view) != AIM_OK ||
        !phase_distances(s->prepared, 1, view.position, &distance, &nearest))
        return;
    if (!(distance >= s->scene.model.march.hit_distance))
        fprintf(stderr,
                "render: warning: the camera is in $.shapes[%d] (%s), or nearer to it than "
                "$.march.hit_distance: all rays end there\n",
                nearest, shape_type_name(s->scene.model.shapes[nearest].type));
}

void driver_warn(const struct session *s) {
    bool single = strcmp(s->program.precision, "float") == 0; // fixed-point numbers refuse a scene
    bool warned = !single && strcmp(s->program.precision, "double") != 0;
    warn_of_hit_distance(&s->scene.model);
    for (int i = 0; i < s->scene.model.shape_count && !warned; i++)
        warned = warn_of_coordinates(s, i, single ? 0x1p-23 : 0x1p-52);
    warn_of_camera(s);
}
