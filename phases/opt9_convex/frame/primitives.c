// Prepares a scene's shapes once (core/prepared.h): frames, sizes, bounds, whether closed forms can draw the
// scene, which repeated shapes share a grid, and the BVH. No vectors here.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/primitives.h"
#include "fields/field.h"
#include "frame/prepare.h"
#include "groups/program.h"
#include "hit/sharp.h"
#include "scene/shadow_bounds.h"
#include "types/ideal.h"

// Sets the sizes and the bound of a group's solid, whose frame is set.
static void prepare_leaf(struct primitive *p, const struct shape *shape,
                         const struct limits *limits) {
    struct primitive sized = prepare_shape(0, shape, limits);
    double bound = bounding_radius(shape);
    memcpy(sized.position, p->position, sizeof p->position);
    memcpy(sized.turn, p->turn, sizeof p->turn);
    sized.turned = p->turned;
    sized.index = p->index;
    sized.eval = EVAL_POINT;
    sized.bound = (float)bound;
    sized.bound_sq = (float)(bound * bound);
    *p = sized;
}

// Moves a group's position to the centre of its sphere.
static void prepare_group(struct primitive *p, const struct field *field,
                          const struct sharp *sharp) {
    p->field = field;
    p->sharp = sharp;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++)
            p->centre[k] += p->row[i][k] * (double)field->centre[i];
        split(p->centre[k], &p->position[k], &p->position_lo[k]);
    }
}

// Returns whether closed forms can draw the copies of a repeated shape, and sets its box. It must lie in its
// cell and be its own mirror image on the axes that repeat, or the wrapped distance jumps at a wall
// (PROOFS.md, 11.). A ray may pass MAX_CELLS cells at most, because floats count them.
enum { MAX_CELLS = 4096 };

static bool fits_its_cells(const struct shape *shape, struct primitive *p,
                           const struct limits *limits) {
    double half[3] = {INFINITY, INFINITY, INFINITY}, cells = 0;
    switch (shape->type) {
    case SHAPE_SPHERE: half[0] = half[1] = half[2] = shape->sphere.radius; break;
    case SHAPE_BOX: memcpy(half, shape->box.half_size, sizeof half); break;
    case SHAPE_ROUNDED_BOX:
        for (int i = 0; i < 3; i++)
            half[i] = shape->box.half_size[i] + shape->box.rounding;
        break;
    case SHAPE_TORUS:
        half[0] = half[2] = shape->torus.major_radius + shape->torus.minor_radius;
        half[1] = shape->torus.minor_radius;
        break;
    case SHAPE_CONE:
        half[0] = half[2] = fmax(shape->cone.bottom_radius, shape->cone.top_radius);
        half[1] = shape->cone.half_height;
        break;
    case SHAPE_OCTAHEDRON: half[0] = half[1] = half[2] = shape->octahedron.radius; break;
    default: return false;
    }
    for (int i = 0; i < 3; i++) {
        if (shape->repeat[i] > 0.0 && half[i] > shape->repeat[i] / 2)
            return false;
        if (shape->repeat[i] > 0.0)
            cells += 2 * limits->bounds_radius / shape->repeat[i];
        p->box[i] = (float)(half[i] + 0x1p-19 * limits->bounds_radius);
    }
    bool jumps = shape->type == SHAPE_CONE && shape->repeat[1] > 0.0;
    return !jumps && cells < MAX_CELLS;
}

static void take_material(struct primitive *p, const struct material *m) {
    to_floats(m->color, p->color);
    p->share = (float)(m->reflectivity * 0.1);
    p->shininess = (float)m->shininess;
    p->shine_from = (float)pow(1e-9, 1.0 / m->shininess);
}

static void prepare_solid(struct primitive *p, const struct shape *shape,
                          const struct model *model) {
    double bound = bounding_radius(shape);
    p->next_same_grid = -1;
    p->leader = (int)p->index;
    if (p->type == SHAPE_TORUS) // hit distance of its march: about 4 ulps of its size
        p->c = (float)ldexp(5e-7, ilogb(shape->torus.major_radius + shape->torus.minor_radius));
    p->bound = (float)bound;
    p->bound_sq = (float)(bound * bound);
    p->convex =
        shape->type != SHAPE_TORUS && shape->type != SHAPE_GROUP && !is_fractal(shape->type);
    take_material(p, &model->materials[shape->material]);
    if (p->eval == EVAL_LINEAR)
        p->c = (float)(shape->plane.offset + p->row[0][0] * p->centre[0] +
                       p->row[0][1] * p->centre[1] + p->row[0][2] * p->centre[2]);
}

// Returns whether lists from a BVH are made sooner than by asking every shape. Where soft shadows are marched,
// they are as soon as the BVH has a second level. By it a frame of 17 spheres, boxes, cones or mixed shapes takes
// 1/1.2 to 1/1.7 of the time, of tori as much. A frame of 16 takes 1.5 to 4 times as long. With hard shadows a
// BVH changes less than a tenth up to 32 shapes. Where soft shadows are closed forms it loses up to there.
static bool bvh_pays(const struct prepared *prepared) {
    bool marches = prepared->model.shadows == SHADOWS_SOFT && !SOFT_IS_IDEAL;
    int count = prepared->model.shape_count;
    return marches ? count - prepared->plane_count > BVH_WIDTH : count >= BVH_MIN_SHAPES;
}

// Builds the BVH, or leaves it without levels. None with a Mandelbulb or a group, whose shadow rays test every shape.
// None if max_steps is below BVH_MIN_MAX_STEPS: batches of shadow rays do not count the steps of each ray.
enum { BVH_MIN_MAX_STEPS = 256 };

static void build_bvh(struct prepared *prepared) {
    int count = prepared->model.shape_count, solids = 0;
    prepared->bvh.levels = 0;
    bool wanted =
        prepared->path == PATH_BVH || (prepared->path == PATH_DEFAULT && bvh_pays(prepared));
    if (!wanted || !prepared->analytic || prepared->known.repeats || prepared->known.bulbs ||
        prepared->model.features.groups || prepared->model.march.max_steps < BVH_MIN_MAX_STEPS)
        return;
    for (int i = 0; i < count; i++) {
        const struct primitive *p = &prepared->primitives[i];
        if (p->eval == EVAL_LINEAR)
            continue;
        struct bvh_leaf *leaf = &prepared->leaves[solids++];
        *leaf = (struct bvh_leaf){.radius = p->bound, .shape = i};
        for (int k = 0; k < 3; k++)
            leaf->centre[k] = p->position[k];
    }
    bvh_build(&prepared->bvh, prepared->leaves, solids);
    for (int i = 0; i < solids; i++)
        prepared->primitives[prepared->bvh.shape[i]].bvh_rank = i;
}

// Links the repeated shapes after `first` that have its frame and its cells.
static void link_same_grid(struct primitive *primitives, int first, int count) {
    struct primitive *s = &primitives[first], *last = s;
    memcpy(s->box_of_grid, s->box, sizeof s->box);
    for (int i = first + 1; i < count && s->repeated && !s->follows_same_grid; i++) {
        struct primitive *p = &primitives[i];
        if (!p->repeated || memcmp(p->centre, s->centre, sizeof s->centre) != 0 ||
            memcmp(p->row, s->row, sizeof s->row) != 0 ||
            memcmp(p->wide_cell, s->wide_cell, sizeof s->wide_cell) != 0)
            continue;
        last->next_same_grid = i;
        last = p;
        p->follows_same_grid = true;
        p->leader = first;
        for (int k = 0; k < 3; k++)
            s->box_of_grid[k] = fmaxf(s->box_of_grid[k], p->box[k]);
    }
}

// Returns the known scene, but for the members that depend on its shapes.
static struct known_scene known_of(const struct model *model) {
    const struct features *features = &model->features;
    const double *background = model->background;
    return (struct known_scene){
        .model = {.shape_count = model->shape_count,
                  .shadows = model->shadows,
                  .shadow_strength = model->shadow_strength,
                  .fog = model->fog,
                  .background = {background[0], background[1], background[2]},
                  .features = {features->rotation, features->repetition, features->mirrors,
                               features->fog},
                  .march = {.bounds_radius = model->march.bounds_radius,
                            .normal_step = model->march.normal_step,
                            .surface_offset = model->march.surface_offset,
                            .max_bounces = model->march.max_bounces}},
        .plane = -1,
        .bulbs = model->features.count[SHAPE_MANDELBULB],
        .lit_slope = lit_slope(model->shadow_strength)};
}

// Sets the balls of parts: each lies in its smallest leaf.
static void set_part_balls(struct sharp *sharp, const struct primitive *group) {
    sharp->balls = sharp->parts;
    for (int part = 0; part < sharp->parts; part++) {
        unsigned kept = sharp->part[part].kept;
        const struct primitive *leaf = &sharp->leaf[kept ? __builtin_ctz(kept) : 0];
        if (!kept || leaf->type == SHAPE_PLANE)
            sharp->balls = 0;
        sharp->ball[part][3] = leaf->bound * (1 + 1e-5f);
        for (int k = 0; k < 3; k++) {
            double at = group->centre[k];
            for (int i = 0; i < 3; i++)
                at += group->row[i][k] * (double)leaf->position[i];
            sharp->ball[part][k] = (float)at;
        }
    }
}

static void add_group(struct prepared *prepared, int i, struct primitive *p) {
    const struct shape *shape = &prepared->model.shapes[i];
    const struct field *field = field_of(prepared->fields, i);
    struct sharp *sharp = &prepared->sharps[prepared->sharp_count];
    bool is_sharp = take_sharp(sharp, shape, field->centre);
    for (int k = 0; k < sharp->leaves && is_sharp; k++) {
        const struct model *model = &prepared->model;
        struct primitive *leaf = &sharp->leaf[k];
        if (sharp->shape[k])
            prepare_leaf(leaf, sharp->shape[k], &model->march);
        if (leaf->index >= 0)
            take_material(leaf, &model->materials[model->nodes[(int)leaf->index].shape.material]);
    }
    prepared->sharp_count += is_sharp;
    prepare_group(p, field, is_sharp ? sharp : NULL);
    if (is_sharp)
        set_part_balls(sharp, p);
}

static bool has_jumps(const struct shape *group) {
    return group->group.nodes[group->group.root].jumps;
}

void prepare_shapes(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    if (SOFT_IS_IDEAL && model->shadows == SHADOWS_IDEAL)
        prepared->model.shadows = SHADOWS_SOFT;
    prepared->analytic = prepared->path != PATH_MARCH && prepared->model.shadows != SHADOWS_IDEAL;
    struct known_scene *known = &prepared->known;
    *known = known_of(&prepared->model);
    known->primitives = prepared->primitives;
    prepared->plane_count = 0;
    for (int i = 0; i < model->shape_count; i++)
        prepared->primitives[i] = prepare_shape(i, &model->shapes[i], &model->march);
    compile_groups(prepared);
    fields_prepare(prepared->fields, prepared, model->shadows == SHADOWS_SOFT && !SOFT_IS_IDEAL);
    prepared->sharp_count = 0;
    for (int i = 0; i < model->shape_count; i++) {
        struct primitive *p = &prepared->primitives[i];
        prepare_solid(p, &model->shapes[i], model);
        if (p->type == SHAPE_GROUP)
            add_group(prepared, i, p);
        if (p->eval == EVAL_LINEAR && known->plane < 0)
            known->plane = i;
        if (p->eval == EVAL_LINEAR)
            prepared->planes[prepared->plane_count++] = i;
        known->repeats = known->repeats || p->repeated;
        if ((p->repeated &&
             (known->bulbs || !fits_its_cells(&model->shapes[i], p, &model->march))) ||
            p->eval == EVAL_POWER || p->type == SHAPE_MANDELBOX ||
            (p->type == SHAPE_GROUP && (!(p->bound < INFINITY) || has_jumps(&model->shapes[i]))) ||
            // With two Mandelbulbs, each one's estimate changes the steps towards the other.
            (p->type == SHAPE_MANDELBULB && (model->march.hit_distance > 0.01 ||
                                             model->shadows == SHADOWS_HARD || known->bulbs > 1)))
            prepared->analytic = false;
    }
    if (model->features.groups && (known->repeats || known->bulbs))
        prepared->analytic = false;
    for (int i = 0; i < model->shape_count && known->repeats; i++)
        link_same_grid(prepared->primitives, i, model->shape_count);
    build_bvh(prepared);
}

bool reserve_prepared(struct prepared *prepared, const struct model *model) {
    size_t count = (size_t)model->shape_count;
    prepared->primitives = calloc(count, sizeof *prepared->primitives);
    prepared->groups = groups_reserve(model);
    prepared->cameras = calloc(count, sizeof *prepared->cameras);
    prepared->planes = calloc(count, sizeof *prepared->planes);
    prepared->leaves = calloc(count, sizeof *prepared->leaves);
    prepared->fields = fields_reserve(model);
    prepared->sharps = calloc((size_t)model->features.groups + 1, sizeof *prepared->sharps);
    return prepared->fields && prepared->sharps && prepared->primitives && prepared->cameras &&
           prepared->planes && prepared->leaves && (prepared->groups || model->node_count == 0) &&
           bvh_reserve(&prepared->bvh, model->shape_count);
}

void free_prepared(struct prepared *prepared) {
    bvh_free(&prepared->bvh);
    fields_free(prepared->fields);
    free(prepared->sharps);
    free(prepared->leaves);
    free(prepared->planes);
    free(prepared->cameras);
    free(prepared->groups);
    free(prepared->primitives);
}
