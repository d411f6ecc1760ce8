// The phase's entry points, and the choice between the kernels for 8 and for 16 lanes: the same sources
// (tile.c, march.c, shade.c), built twice.
#include <math.h>
#include <stdalign.h>
#include <stdlib.h>
#include <string.h>

#include "flops.h"
#include "kernel.h"
#include "threads.h"
#include "variant.h"

// Of a generated kernel; without a Mandelbulb half as many are a crowd.
enum { MOST_SHAPES = 64 };

// What the march reads is `prepared`, as in opt4; the team stands behind it.
struct kept {
    struct prepared prepared;
    struct team *team;
    bool sixteen; // lanes, not eight
    struct loaded loaded;
};

const char *phase_unsupported(const struct scene *scene) {
    (void)scene;
    return NULL;
}

// Rotation about x, then y, then z as one matrix: (u, v) turns to (c·u − s·v, s·u + c·v) on (y,z),
// then (x,z), then (x,y).
static void rotation_matrix(const double *degrees, double m[3][3]) {
    static const int pair[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    memcpy(m, (double[3][3]){{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 9 * sizeof(double));
    for (int axis = 0; axis < 3; axis++) {
        double radians = degrees[axis] * (M_PI / 180.0), c = cos(radians), s = sin(radians);
        for (int k = 0; k < 3; k++) {
            double *u = &m[pair[axis][0]][k], *v = &m[pair[axis][1]][k], old = *u;
            *u = c * old - s * *v;
            *v = s * old + c * *v;
        }
    }
}

static void to_floats(const double from[3], float to[3]) {
    for (int i = 0; i < 3; i++)
        to[i] = (float)from[i];
}

// See struct placed. A plane that is not repeated has one row.
static void place_rows(struct placed *p, const struct shape *shape, double turn[3][3]) {
    bool linear = p->way == LINEAR;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double *n = shape->plane.normal;
            p->row[i][j] =
                linear ? n[0] * turn[0][j] + n[1] * turn[1][j] + n[2] * turn[2][j] : turn[i][j];
        }
        p->centre[i] = shape->position[i];
    }
    if (p->way == POWER) {
        p->radius_sq = shape->sphere.radius * shape->sphere.radius;
        p->b = (float)p->radius_sq;
    }
    if (linear) {
        p->offset = shape->plane.offset;
        to_floats(p->row[0], p->normal);
    }
}

// Of a sphere wider than the bounds only a piece is seen, from nearer than its radius, so that its
// power is as exact as a point would be, and much more so near the surface. Elsewhere a point is
// cheaper, and from many radii away more exact. 1e15: its square is a float.
static enum way way_of(const struct shape *shape, bool repeated, const struct limits *limits) {
    if (repeated)
        return AT_POINT;
    if (shape->type == SHAPE_SPHERE && shape->sphere.radius >= limits->bounds_radius &&
        shape->sphere.radius < 1e15)
        return POWER;
    return shape->type == SHAPE_PLANE ? LINEAR : AT_POINT;
}

static struct placed place_shape(int index, const struct shape *shape,
                                 const struct limits *limits) {
    struct placed p = {.type = shape->type, .index = (float)index, .alike = -1, .leader = index};
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
    p.way = way_of(shape, p.repeated, limits);
    place_rows(&p, shape, turn);
    switch (shape->type) {
    case SHAPE_SPHERE: p.a = (float)shape->sphere.radius; break;
    case SHAPE_BOX: to_floats(shape->box.half_size, p.size); break;
    case SHAPE_ROUNDED_BOX:
        to_floats(shape->box.half_size, p.size);
        p.a = (float)shape->box.rounding;
        break;
    case SHAPE_TORUS:
        p.a = (float)shape->torus.major_radius;
        p.b = (float)shape->torus.minor_radius;
        // How near is there: some 4 ulps of its size, which is all that floats can tell.
        p.c = (float)ldexp(5e-7, ilogb(shape->torus.major_radius + shape->torus.minor_radius));
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
    default:
        p.bailout = (float)shape->mandelbulb.bailout;
        p.iterations = shape->mandelbulb.iterations;
        break;
    }
    return p;
}

// A sphere about the shape's position that holds it. 1e-5: what is rounded must not cut it.
static double bound_of(const struct shape *shape) {
    const double *half = shape->box.half_size;
    switch (shape->type) {
    case SHAPE_SPHERE: return shape->sphere.radius;
    case SHAPE_BOX:
        return sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2]) * (1 + 1e-5);
    case SHAPE_ROUNDED_BOX:
        return (hypot(hypot(half[0], half[1]), half[2]) + shape->box.rounding) * (1 + 1e-5);
    case SHAPE_TORUS: return (shape->torus.major_radius + shape->torus.minor_radius) * (1 + 1e-5);
    case SHAPE_CONE:
        return hypot(fmax(shape->cone.bottom_radius, shape->cone.top_radius),
                     shape->cone.half_height) *
               (1 + 1e-5);
    case SHAPE_OCTAHEDRON: return shape->octahedron.radius * (1 + 1e-5);
    case SHAPE_MANDELBULB: return 1.15; // beyond 2^(1/7) every point escapes; see bulb.h
    default: return INFINITY;
    }
}

// A repeated shape whose copies have a closed form together: it is in its cell, and the cell's mirror image along every
// axis that it is repeated on, or its wrapped distance would jump at a wall. A ray goes through no more cells than
// MOST_CELLS, and float counts them.
enum { MOST_CELLS = 4096 };

static bool cells_hold(const struct shape *shape, struct placed *p, const struct limits *limits) {
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
    return !jumps && cells < MOST_CELLS;
}

static void place_solid(struct placed *p, const struct shape *shape, const struct model *model) {
    double bound = bound_of(shape);
    p->bound = (float)bound;
    p->bound_sq = (float)(bound * bound);
    p->convex = shape->type != SHAPE_TORUS && shape->type != SHAPE_MANDELBULB;
    const struct material *m = &model->materials[shape->material];
    to_floats(m->color, p->color);
    p->share = (float)(m->reflectivity * 0.1);
    p->shininess = (float)m->shininess;
    p->shine_from = (float)pow(1e-9, 1.0 / m->shininess);
    if (p->way == LINEAR)
        p->c = (float)(shape->plane.offset + p->row[0][0] * p->centre[0] +
                       p->row[0][1] * p->centre[1] + p->row[0][2] * p->centre[2]);
}

// The least slope q such that a ray with h(t) ≥ q·t all along has no term of the soft shadow's estimator below
// 1, whatever its steps (NOTES.md): strength·min(q, q·√(1 − (1+q)²/4)/(1 − q·(1+q)/2)) ≥ 1. Both rise with q.
static float lit_slope(double strength) {
    double low = 0, high = 1;
    for (int i = 0; i < 60; i++) {
        double q = (low + high) / 2, r = (1 + q) / 2;
        double away = q * sqrt(1 - r * r) / (1 - q * r);
        *(strength * fmin(q, away) >= 1 ? &high : &low) = q;
    }
    return (float)(high * (1 + 1e-5));
}

// A scene of this many shapes is a crowd: of two nodes of the tree or more. Not with a Mandelbulb, whose shadow
// streams ask every shape. Nor where a low step cap may end a soft shadow: the rays of a crowd's packet wait for each
// other, and their steps are not counted ray by ray.
enum { CROWD = 2 * TREE_WIDTH, FEW_STEPS = 256 };

static void plant(struct prepared *prepared) {
    int count = prepared->model.shape_count, solids = 0;
    prepared->tree.levels = 0;
    if (count < CROWD || !prepared->solids || prepared->repeats || prepared->bulbs ||
        prepared->model.march.max_steps < FEW_STEPS)
        return;
    for (int i = 0; i < count; i++) {
        const struct placed *p = &prepared->placed[i];
        if (p->way == LINEAR)
            continue;
        struct leaf *leaf = &prepared->leaves[solids++];
        *leaf = (struct leaf){.radius = p->bound, .shape = i};
        for (int k = 0; k < 3; k++)
            leaf->centre[k] = p->position[k];
    }
    tree_build(&prepared->tree, prepared->leaves, solids);
    for (int i = 0; i < solids; i++) {
        struct placed *p = &prepared->placed[prepared->tree.shape[i]];
        p->alone = tree_gap(&prepared->tree, i);
        p->rank = i;
    }
}

// Of a repeated shape the others behind it that are repeated so in the same frame.
static void find_alike(struct placed *placed, int first, int count) {
    struct placed *s = &placed[first], *last = s;
    memcpy(s->around, s->box, sizeof s->box);
    for (int i = first + 1; i < count && s->repeated && !s->led; i++) {
        struct placed *p = &placed[i];
        if (!p->repeated || memcmp(p->centre, s->centre, sizeof s->centre) != 0 ||
            memcmp(p->row, s->row, sizeof s->row) != 0 ||
            memcmp(p->wide_cell, s->wide_cell, sizeof s->wide_cell) != 0)
            continue;
        last->alike = i;
        last = p;
        p->led = true;
        p->leader = first;
        for (int k = 0; k < 3; k++)
            s->around[k] = fmaxf(s->around[k], p->box[k]);
    }
}

static void place_all(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    prepared->solids = true;
    prepared->repeats = false;
    prepared->plane = -1;
    prepared->bulbs = model->features.count[SHAPE_MANDELBULB];
    prepared->lit_slope = lit_slope(model->shadow_strength);
    prepared->plane_count = 0;
    for (int i = 0; i < model->shape_count; i++) {
        struct placed *p = &prepared->placed[i];
        *p = place_shape(i, &model->shapes[i], &model->march);
        place_solid(p, &model->shapes[i], model);
        if (p->way == LINEAR && prepared->plane < 0)
            prepared->plane = i;
        if (p->way == LINEAR)
            prepared->planes[prepared->plane_count++] = i;
        prepared->repeats = prepared->repeats || p->repeated;
        if ((p->repeated &&
             (prepared->bulbs || !cells_hold(&model->shapes[i], p, &model->march))) ||
            p->way == POWER ||
            // of two Mandelbulbs each one's estimate is a part of the other's steps
            (p->type == SHAPE_MANDELBULB &&
             (model->march.hit_distance > 0.01 || model->shadows == SHADOWS_HARD ||
              prepared->bulbs > 1)))
            prepared->solids = false;
    }
    for (int i = 0; i < model->shape_count && prepared->repeats; i++)
        find_alike(prepared->placed, i, model->shape_count);
    plant(prepared);
}

// A kernel has its shapes' places as constants: once they move general code runs, and the record says so.
bool phase_update(struct prepared *prepared, const struct model *model) {
    struct loaded *loaded = &((struct kept *)prepared)->loaded; // its first member
    place_all(prepared, model);
    if (loaded->kernel) {
        kernel_unload(loaded);
        loaded->facts = (struct kernel_facts){
            .reason = "the shapes move: a kernel is generated for one place of each"};
    }
    return true;
}

static void release(struct kept *kept) {
    if (!kept)
        return;
    kernel_unload(&kept->loaded);
    struct prepared *prepared = &kept->prepared;
    tree_free(&prepared->tree);
    free(prepared->leaves);
    free(prepared->planes);
    free(prepared->placed);
    free(prepared->eyes);
    free(kept);
}

static void make_kernel(struct kept *kept) {
    struct loaded *loaded = &kept->loaded;
#ifdef STEPWISE_COUNT
    loaded->facts.reason = "a counting build counts the general kernels";
#else
    if (!kept->prepared.solids)
        loaded->facts.reason = "the scene is marched: no kernel is generated for that";
    else if (kept->prepared.tree.levels)
        loaded->facts.reason =
            "a crowd of 32 shapes or more is asked from a tree: no kernel is generated for that";
    else if (kept->prepared.model.shape_count > MOST_SHAPES)
        loaded->facts.reason = "more shapes than a generated kernel gains from";
    else
        kernel_load(&kept->prepared, variant_here().lanes, variant_here().flags, loaded);
#endif
}

const struct kernel_facts *phase_kernel(const struct prepared *prepared) {
    return &((const struct kept *)prepared)->loaded.facts;
}

static struct team *start_team(struct kept *kept, const struct model *model, int threads) {
    place_all(&kept->prepared, model);
    make_kernel(kept);
    size_t own = kept->sixteen ? lanes16_own_size(model) : lanes8_own_size(model);
    if (kept->loaded.kernel && kept->loaded.kernel->own_size > own)
        own = kept->loaded.kernel->own_size;
    return team_start(threads, own);
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct kept *kept = calloc(1, sizeof *kept);
    size_t count = (size_t)model->shape_count;
    if (!kept)
        return NULL;
    struct prepared *prepared = &kept->prepared;
    prepared->placed = calloc(count, sizeof *prepared->placed);
    prepared->eyes = calloc(count, sizeof *prepared->eyes);
    prepared->planes = calloc(count, sizeof *prepared->planes);
    prepared->leaves = calloc(count, sizeof *prepared->leaves);
    kept->sixteen = variant_here().lanes == 16;
    if (prepared->placed && prepared->eyes && prepared->planes && prepared->leaves &&
        (count < CROWD || tree_reserve(&prepared->tree, model->shape_count)))
        kept->team = start_team(kept, model, threads);
    if (!kept->team) {
        release(kept);
        return NULL;
    }
    return prepared;
}

void phase_release(struct prepared *prepared) {
    struct kept *kept = (struct kept *)prepared; // its first member
    team_end(kept->team);
    release(kept);
}

// Apart from what the caller writes on its stack: all workers read it.
struct frame_job {
    alignas(APART) struct job job;
    const struct scene_kernel *kernel; // NULL: the general ones
    bool sixteen;
};

void render_tile(const void *data, int tile, void *own) {
    const struct frame_job *job = data;
    if (job->kernel)
        job->kernel->tile(&job->job, tile, own);
    else if (job->sixteen)
        lanes16_tile(&job->job, tile, own);
    else
        lanes8_tile(&job->job, tile, own);
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Whether the camera is outside of the box about the copy whose cell it is in.
static bool beside_copies(const struct placed *p, const double from[3], double far,
                          struct eye *eye) {
    bool outside = false;
    for (int k = 0; k < 3; k++) {
        double at = dot(p->row[k], from);
        at -= p->wide_cell[k] * floor(at * p->wide_per_cell[k] + 0.5);
        split(at, &eye->at[k], &eye->rest[k]);
        outside = outside || fabs(at) > (double)p->box[k] + far;
    }
    return outside;
}

// Whether the frame can be had without marching camera rays: the camera is within the bounds and outside of
// every solid's bounding sphere (repeated: box) and plane.
static bool set_eyes(const struct prepared *prepared, const struct view *view) {
    double radius = prepared->model.march.bounds_radius, far = prepared->model.march.hit_distance;
    bool clear = dot(view->position, view->position) < radius * radius;
    for (int i = 0; i < prepared->model.shape_count; i++) {
        const struct placed *p = &prepared->placed[i];
        struct eye *eye = &prepared->eyes[i];
        double from[3];
        for (int k = 0; k < 3; k++)
            from[k] = view->position[k] - p->centre[k];
        const double *axis[3] = {view->right, view->up, view->forward};
        if (p->way == LINEAR) {
            double height = dot(p->row[0], from) - p->offset;
            eye->height = (float)height;
            for (int k = 0; k < 3; k++)
                eye->centre[k] = (float)dot(p->row[0], axis[k]);
            clear = clear && height > far;
            continue;
        }
        if (p->repeated) {
            clear = clear && beside_copies(p, from, far, eye);
            for (int k = 0; k < 3; k++) {
                eye->centre[k] = (float)-dot(p->row[k], view->position);
                for (int j = 0; j < 3; j++)
                    eye->axis[j][k] = (float)dot(p->row[k], axis[j]);
            }
            continue;
        }
        for (int k = 0; k < 3; k++) {
            eye->at[k] = (float)dot(p->row[k], from);
            eye->centre[k] = (float)-dot(from, axis[k]);
        }
        // A Mandelbulb's rays are marched wherever they begin (but within it: see below).
        clear = clear &&
                (p->type == SHAPE_MANDELBULB || sqrt(dot(from, from)) > (double)p->bound + far);
    }
    return clear;
}

// A camera within a Mandelbulb sees what its march leaves there: normals from estimates of -0.2, where 14 bits of one
// are 1e-5 and a normal's step is 1e-4 (18° of error, median of 57 such cameras). march.c has all bits. That a nearer
// shape is no other one is set_eyes' to say, before.
static bool within_a_bulb(const struct prepared *prepared, const struct view *view) {
    if (!prepared->bulbs)
        return false;
    double distance;
    int nearest;
    phase_distances(prepared, 1, view->position, &distance, &nearest);
    return !(distance > prepared->model.march.hit_distance);
}

// Taller where a tile's rays must share the wait for the slowest of them (Mandelbulbs), or be sorted (crowds).
static int tile_height(const struct prepared *prepared, const struct frame *frame) {
    if (prepared->bulbs)
        return frame->height > 256 ? 128 : 64;
    return prepared->tree.levels ? 64 : 8;
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    COUNT(phase_render, call);
    const struct kept *kept = (const struct kept *)prepared; // its first member
    struct frame_job job = {
        {prepared, view, frame, prepared->eyes, tile_height(prepared, frame),
         prepared->solids && set_eyes(prepared, view) && !within_a_bulb(prepared, view)},
        NULL,
        kept->sixteen};
    if (job.job.solids)
        job.kernel = kept->loaded.kernel;
    team_run(kept->team, &job,
             job.kernel      ? job.kernel->tiles(&job.job)
             : kept->sixteen ? lanes16_tiles(&job.job)
                             : lanes8_tiles(&job.job));
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    const struct kept *kept = (const struct kept *)prepared; // its first member
    return kept->sixteen ? lanes16_distances(prepared, count, points, distance, nearest)
                         : lanes8_distances(prepared, count, points, distance, nearest);
}
