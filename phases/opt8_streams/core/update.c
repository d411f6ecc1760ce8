// Prepares the scene in the form that the march needs, again whenever it has moved.
#include "core/prepare_bounds.h"
#include "groups/program.h"
#include "phase.h"
#include "scene/shadow_bounds.h"

// Sets the members that shadow cones and shading need.
static void prepare_solid(struct primitive *p, const struct shape *shape,
                          const struct model *model) {
    double bound = p->eval == EVAL_FIELD             ? INFINITY
                   : shape->type == SHAPE_MANDELBULB ? BALL_RADIUS
                                                     : bounding_radius(shape);
    p->bound = (float)bound;
    p->bound_sq = (float)(bound * bound);
    p->convex = shape->type != SHAPE_TORUS && !is_fractal(shape->type);
    if (p->eval == EVAL_LINEAR)
        p->over = (float)(shape->plane.offset + p->row[0][0] * p->centre[0] +
                          p->row[0][1] * p->centre[1] + p->row[0][2] * p->centre[2]);
    const struct material *m = &model->materials[shape->material];
    to_floats(m->color, p->color);
    p->share = (float)(m->reflectivity * 0.1);
    p->shininess = (float)m->shininess;
    p->shine_from = (float)pow(1e-9, 1.0 / m->shininess);
}

// Returns the slope for hard shadows: a ray above it is nowhere within twice the hit distance of a surface.
static float lit_slope_hard(const struct limits *limits) {
    return (float)fmax(1e-3, 2.0 * limits->hit_distance / limits->surface_offset);
}

// Sets the shape's shadow cone. Outside of its ball a Mandelbulb's estimate is at least half of the way to the ball,
// so hard shadows need twice the slope. It clears no soft shadow: its estimate may grow by more than a step
// (PROOFS.md, 1).
static void prepare_cone(struct primitive *p, float q, bool soft) {
    p->slope_lit = p->type == SHAPE_MANDELBULB ? (soft ? 1 : fminf(2 * q, 1)) : q;
    p->slope_bound = p->slope_lit * p->bound;
    p->slope_a = 1 - p->slope_lit * p->slope_lit;
}

// Whether one Mandelbulb, not repeated and within the bounds, and at most one plane are all shapes.
static bool is_single_bulb(const struct prepared *prepared) {
    const struct model *model = &prepared->model;
    int planes = 0;
    for (int i = 0; i < model->shape_count; i++) {
        const struct primitive *p = &prepared->primitives[i];
        if (p->type == SHAPE_MANDELBULB) {
            const double *at = p->centre;
            double away = sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]);
            if (p->repeated || !(away + p->a < model->march.bounds_radius * (1 - 1e-6)))
                return false;
        } else if (p->eval == EVAL_LINEAR)
            planes++;
        else
            return false;
    }
    return prepared->bulbs == 1 && planes <= 1 && model->march.hit_distance < BULB_SINGLE_HIT;
}

// Sets what lists and cones need of a group. Outside of its sphere, `radius` around `position`, its distance is at least
// growth/lipschitz times as far: shadow cones are wider by that. Their slope is below 1, or it clears no ray.
static void prepare_group(struct prepared *prepared, int index) {
    struct primitive *p = &prepared->primitives[index];
    const struct model *model = &prepared->model;
    if (p->eval != EVAL_FIELD)
        return;
    const struct node *root = &model->nodes[model->shapes[index].group.root];
    prepare_group_bounds(p);
    for (int k = 0; k < 3; k++)
        p->position[k] = (float)(p->centre[k] + p->row[0][k] * root->centre[0] +
                                 p->row[1][k] * root->centre[1] + p->row[2][k] * root->centre[2]);
    p->bound = (float)(root->radius * (1 + 1e-5)) + 2 * p->error;
    p->bound_sq = p->bound * p->bound;
    double q = prepared->lit_slope * root->lipschitz / root->growth * (1 + 1e-5);
    if (model->shadows == SHADOWS_SOFT &&
        !node_is_distance(model->nodes, (int)(root - model->nodes)))
        q = 1; // PROOFS.md, 9.
    p->slope_lit = (float)fmin(q, 1);
    p->slope_bound = p->slope_lit * p->bound;
    p->slope_a = 1 - p->slope_lit * p->slope_lit;
    prepared->all_bounded = prepared->all_bounded && p->steady && root->radius < INFINITY;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    prepared->all_bounded = true;
    prepared->bulbs = model->features.count[SHAPE_MANDELBULB];
    prepared->lit_slope = model->shadows == SHADOWS_HARD ? lit_slope_hard(&model->march)
                                                         : lit_slope(model->shadow_strength);
    for (int i = 0; i < model->shape_count; i++) {
        struct primitive *p = &prepared->primitives[i];
        *p = prepare_shape(i, &model->shapes[i], &model->march);
        prepare_bounds(p, &model->shapes[i], &model->march);
        prepare_solid(p, &model->shapes[i], model);
        prepare_cone(p, prepared->lit_slope, model->shadows != SHADOWS_HARD);
        prepared->all_bounded = prepared->all_bounded && !p->repeated && p->eval != EVAL_POWER;
    }
    prepared->single_bulb = is_single_bulb(prepared);
    compile_groups(prepared);
    for (int i = 0; i < model->shape_count && prepared->groups; i++)
        prepare_group(prepared, i);
    list_shapes(prepared);
    return true;
}
