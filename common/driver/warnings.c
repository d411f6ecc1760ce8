// Warnings: what a scene file may say, but the renderers of this project draw wrong or not at all (scenes/README.md).
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "driver/driver.h"

// Returns the smallest length of a shape, +inf for a plane.
static double size_of(const struct shape *s) {
    const double *half = s->box.half_size;
    switch (s->type) {
    case SHAPE_SPHERE: return s->sphere.radius;
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX: return fmin(half[0], fmin(half[1], half[2])) + s->box.rounding;
    case SHAPE_TORUS: return s->torus.minor_radius;
    case SHAPE_CONE:
        return fmin(fmax(s->cone.bottom_radius, s->cone.top_radius), s->cone.half_height);
    case SHAPE_OCTAHEDRON: return s->octahedron.radius / sqrt(3); // to a face
    case SHAPE_MANDELBULB: return 1;
    case SHAPE_MANDELBOX: return s->mandelbox.fold_limit;
    default: return INFINITY;
    }
}

// A march ends where the distance is below hit_distance: in front of a smaller shape it ends far from it.
static void warn_of_hit_distance(const struct model *model) {
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        if (size_of(shape) < model->march.hit_distance) {
            fprintf(stderr,
                    "render: warning: $.march.hit_distance: %g is more than the size of "
                    "$.shapes[%d] (%s, "
                    "%g), which is drawn too large\n",
                    model->march.hit_distance, i, shape_type_name(shape->type), size_of(shape));
            return;
        }
    }
}

// Returns the largest magnitude of three coordinates.
static double reach(const double at[3]) {
    return fmax(fabs(at[0]), fmax(fabs(at[1]), fabs(at[2])));
}

// A number of `bits` cannot be closer to the next than 2^(1 − bits) of itself, while normals are differences over
// normal_step, and secondary rays start surface_offset off a surface.
static void warn_of_coordinates(const struct session *s) {
    const struct model *model = &s->scene.model;
    const char *precision = s->program.precision;
    bool single = strcmp(precision, "float") == 0;
    if (!single && strcmp(precision, "double") != 0)
        return; // fixed-point numbers say themselves how far they go
    double ulp = single ? 0x1p-23 : 0x1p-52, far = reach(s->scene.view.position);
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        far = fmax(far,
                   shape->type == SHAPE_PLANE ? fabs(shape->plane.offset) : reach(shape->position));
    }
    double least = fmin(model->march.normal_step, model->march.surface_offset);
    if (far * ulp > least)
        fprintf(stderr,
                "render: warning: at coordinates of %g the %ss of %s are %.2g apart: "
                "$.march.normal_step and .surface_offset should be more than that, or the scene be "
                "nearer to 0\n",
                far, precision, s->program.phase, far * ulp);
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
    warn_of_hit_distance(&s->scene.model);
    warn_of_coordinates(s);
    warn_of_camera(s);
}
