// The phase's entry points and its loop over pixels: eight neighbours of a row at a time, one ray
// through the middle of each; the last packet of a row is filled up by mask, so any width will do.
// A tile is a whole number of packets wide: the packets are those of opt4, and so is every bit.
#include <stdalign.h>
#include <stdlib.h>
#include <string.h>

#include "phase.h"
#include "threads.h"
#include "tiles.h"

// A tile is drawn by one worker: a block for each lane, so that their cones march together. A block is
// as wide as a packet.
enum { BLOCK = 8, ACROSS = 4, TILE_WIDTH = ACROSS * BLOCK, TILE_HEIGHT = LANES / ACROSS * BLOCK };

// Beyond it the power-8 map's orbits escape (|w|⁸ − r ≥ 3.1 from |w| = r = 1.2 on), and its estimate is at
// least half of the distance to that ball: tests/py/test_tiles.py samples it.
#define BALL_RADIUS 1.2f

// What the march reads is `prepared`, as in opt4; the team stands behind it.
struct kept {
    struct prepared prepared;
    struct team *team; // each worker's own: an approach per shape
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

// A wrapped distance is a distance where the shape is the mirror image of itself at its cell's walls.
static enum trust trust_of(const struct shape *shape, bool repeated) {
    if (repeated && (shape->type == SHAPE_PLANE || shape->type == SHAPE_CONE))
        return NOTHING;
    return shape->type == SHAPE_MANDELBULB ? BALL : DISTANCE;
}

// What the coordinates of its surface are made of, to a factor of a few.
static float size_of(const struct shape *shape) {
    const double *half = shape->box.half_size;
    switch (shape->type) {
    case SHAPE_SPHERE: return (float)shape->sphere.radius;
    case SHAPE_BOX: return (float)(half[0] + half[1] + half[2]);
    case SHAPE_TORUS: return (float)(shape->torus.major_radius + shape->torus.minor_radius);
    case SHAPE_CONE:
        return (float)(shape->cone.bottom_radius + shape->cone.top_radius +
                       shape->cone.half_height);
    case SHAPE_OCTAHEDRON: return (float)shape->octahedron.radius;
    case SHAPE_PLANE: return (float)fabs(shape->plane.offset);
    default: return 1.0f;
    }
}

static struct placed place_shape(int index, const struct shape *shape,
                                 const struct limits *limits) {
    struct placed p = {.type = shape->type, .index = (float)index};
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
    p.trust = trust_of(shape, p.repeated);
    place_rows(&p, shape, turn);
    switch (shape->type) {
    case SHAPE_SPHERE: p.a = (float)shape->sphere.radius; break;
    case SHAPE_BOX: to_floats(shape->box.half_size, p.size); break;
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
    default:
        p.a = BALL_RADIUS + 2.0f * (float)limits->hit_distance;
        p.bailout = (float)shape->mandelbulb.bailout;
        p.iterations = shape->mandelbulb.iterations;
        break;
    }
    p.slack = 0x1p-19f * size_of(shape);
    return p;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    for (int i = 0; i < model->shape_count; i++)
        prepared->placed[i] = place_shape(i, &model->shapes[i], &model->march);
    return true;
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct kept *kept = calloc(1, sizeof *kept);
    struct placed *placed = calloc((size_t)model->shape_count, sizeof *placed);
    int *all = calloc((size_t)model->shape_count, sizeof *all);
    if (kept && placed && all)
        kept->team = team_start(threads, own_size(model->shape_count));
    if (!kept || !placed || !all || !kept->team) {
        free(kept);
        free(all);
        free(placed);
        return NULL;
    }
    kept->prepared.placed = placed;
    kept->prepared.all = (struct list){model->shape_count, all};
    for (int i = 0; i < model->shape_count; i++)
        all[i] = i;
    phase_update(&kept->prepared, model);
    return &kept->prepared;
}

void phase_release(struct prepared *prepared) {
    struct kept *kept = (struct kept *)prepared; // its first member
    team_end(kept->team);
    free(prepared->placed);
    free((void *)prepared->all.shape);
    free(kept);
}

static struct vec vec_from(const double a[3]) {
    return (struct vec){set((float)a[0]), set((float)a[1]), set((float)a[2])};
}

static struct place place_of(const double a[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(a[i], &hi[i], &lo[i]);
    return (struct place){vec_set(hi), vec_set(lo)};
}

static struct vec get_direction(int column, int row, const struct frame *frame,
                                const struct view *view) {
    COUNT(get_direction, call);
    COUNT(get_direction, scalar);
    double per_height = view->tan_half_fov / frame->height;
    float first = (float)(2.0 * column + 1.0 - frame->width); // a whole number: exact
    real columns = set(first) + _mm256_setr_ps(0, 2, 4, 6, 8, 10, 12, 14);
    real x = columns * set((float)per_height);
    real y = set((float)((frame->height - 1.0 - 2.0 * row) * per_height));
    struct vec d = vec_along(vec_from(view->forward), vec_from(view->right), x);
    d = vec_along(d, vec_from(view->up), y);
    return vec_scale(d, set(1.0f) / vec_norm(d));
}

static void store_plane(float *plane, int stride, int count, real values) {
    float lanes[LANES];
    _mm256_storeu_ps(lanes, values);
    for (int lane = 0; lane < count; lane++)
        plane[lane * stride] = lanes[lane];
}

static void store(struct frame *frame, size_t pixel, int count, real start, int shapes,
                  const struct shaded *seen) {
    COUNT(store, call);
    float *rgb = frame->rgb + 3 * pixel;
    store_plane(rgb, 3, count, seen->color.x);
    store_plane(rgb + 1, 3, count, seen->color.y);
    store_plane(rgb + 2, 3, count, seen->color.z);
    if (!frame->depth)
        return;
    const struct hit *hit = &seen->hit;
    float *normal = frame->normal + 3 * pixel;
    store_plane(frame->depth + pixel, 1, count, choose(hit->found, hit->t, set(INFINITY)));
    store_plane(frame->id + pixel, 1, count, hit->shape);
    store_plane(normal, 3, count, hit->normal.x);
    store_plane(normal + 1, 3, count, hit->normal.y);
    store_plane(normal + 2, 3, count, hit->normal.z);
    store_plane(frame->evals + pixel, 1, count, hit->evals);
    if (frame->plane_count) {
        store_plane(frame->planes[0] + pixel, 1, count, start);
        store_plane(frame->planes[1] + pixel, 1, count, set((float)shapes));
    }
}

static mask lanes_of(int used) {
    __m256i lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    return _mm256_castsi256_ps(
        _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(used), lane), lane));
}

// Lanes below `count`.
static mask first_lanes(int count) {
    return less(_mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7), set((float)count));
}

static struct approach *new_approaches(const struct prepared *prepared) {
    return aligned_alloc(32, (size_t)prepared->model.shape_count * sizeof(struct approach));
}

struct job { // read by all, so apart from what the caller writes on its stack
    alignas(APART) const struct prepared *prepared;
    const struct view *view;
    struct frame *frame;
    struct place origin;
    int across; // tiles
};

struct block { // of pixels
    int left, top, right, bottom;
};

static struct block block_of(int tile, int lane, const struct job *job) {
    int left = tile % job->across * TILE_WIDTH + lane % ACROSS * BLOCK;
    int top = tile / job->across * TILE_HEIGHT + lane / ACROSS * BLOCK;
    const struct frame *frame = job->frame;
    return (struct block){left, top, frame->width - left < BLOCK ? frame->width : left + BLOCK,
                          frame->height - top < BLOCK ? frame->height : top + BLOCK};
}

static struct vec unit(struct vec v) {
    return vec_scale(v, set(1.0f) / vec_norm(v));
}

// Through the middles of its corner pixels: no ray between is further from the axis, for the circle
// about the axis is an ellipse in the picture, and what is in it between two of its points.
static mask get_cones(int tile, const struct job *job, struct cones *cones) {
    COUNT(get_cones, call);
    COUNT(get_cones, scalar);
    const struct view *view = job->view;
    const struct frame *frame = job->frame;
    double per_height = view->tan_half_fov / frame->height;
    float edge[4][LANES] = {{0}};
    int used = 0;
    for (int lane = 0; lane < LANES; lane++) {
        struct block b = block_of(tile, lane, job);
        if (b.left >= b.right || b.top >= b.bottom)
            continue;
        used |= 1 << lane;
        edge[0][lane] = (float)((2.0 * b.left + 1.0 - frame->width) * per_height);
        edge[1][lane] = (float)((2.0 * b.right - 1.0 - frame->width) * per_height);
        edge[2][lane] = (float)((frame->height - 1.0 - 2.0 * b.top) * per_height);
        edge[3][lane] = (float)((frame->height + 1.0 - 2.0 * b.bottom) * per_height);
    }
    real x[2] = {_mm256_loadu_ps(edge[0]), _mm256_loadu_ps(edge[1])};
    real y[2] = {_mm256_loadu_ps(edge[2]), _mm256_loadu_ps(edge[3])};
    struct vec forward = vec_from(view->forward), right = vec_from(view->right);
    struct vec up = vec_from(view->up), corner[4], sum = {set(0.0f), set(0.0f), set(0.0f)};
    for (int i = 0; i < 4; i++) {
        corner[i] = unit(vec_along(vec_along(forward, right, x[i & 1]), up, y[i >> 1]));
        sum = vec_along(sum, corner[i], set(1.0f));
    }
    cones->axis = unit(sum);
    real most = set(0.0f);
    for (int i = 0; i < 4; i++) {
        struct vec apart = vec_along(corner[i], cones->axis, set(-1.0f));
        most = most_of(most, vec_dot(apart, apart));
    }
    cones->spread = mul_add(root(most), set(1.0f + 0x1p-16f), set(0x1p-20f));
    return lanes_of(used);
}

static void miss_block(struct block b, const struct job *job) {
    const double *c = job->prepared->model.background;
    struct shaded nothing = {.color = vec_from(c), .hit = {.shape = set(-1.0f)}};
    for (int row = b.top; row < b.bottom; row++)
        store(job->frame, (size_t)row * (size_t)job->frame->width + (size_t)b.left,
              b.right - b.left, set(INFINITY), 0, &nothing);
}

static void render_block(struct block b, real start, const struct job *job, struct world *world) {
    COUNT(render_block, call);
    struct frame *frame = job->frame;
    int count = b.right - b.left;
    for (int row = b.top; row < b.bottom; row++) {
        ACTIVE(count);
        COUNT(render_block, packet);
        for (int i = 0; i < world->list.count; i++) {
            int shape = world->list.shape[i];
            world->approach[shape].origin = world->own->eye[shape].origin;
            world->approach[shape].power = world->own->eye[shape].power;
        }
        struct shaded seen;
        trace(job->origin, get_direction(b.left, row, frame, job->view), first_lanes(count), start,
              0, world, &seen);
        ACTIVE(count);
        store(frame, (size_t)row * (size_t)frame->width + (size_t)b.left, count, start,
              world->list.count, &seen);
    }
}

void render_tile(const void *data, int tile, void *memory) {
    COUNT(render_tile, call);
    const struct job *job = data;
    const struct prepared *scene = job->prepared;
    struct own own = own_of(memory, scene->model.shape_count);
    struct world world = {scene, job->view, own.approach, scene->all, &own};
    struct cones cones;
    mask active = get_cones(tile, job, &cones);
    approach_origins(job->origin, scene, scene->all, own.eye);
    march_cones(job->origin, active, &cones, scene, &own);
    float start[LANES];
    _mm256_storeu_ps(start, cones.start);
    for (int lane = 0; lane < LANES; lane++) {
        struct block b = block_of(tile, lane, job);
        if (!(bits(active) >> lane & 1))
            continue;
        if (start[lane] == INFINITY) {
            miss_block(b, job);
            continue;
        }
        world.list = list_of_cone(lane, scene, &own);
        render_block(b, set(start[lane]), job, &world);
    }
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    COUNT(phase_render, call);
    const struct kept *kept = (const struct kept *)prepared; // its first member
    int across = (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
    int down = (frame->height + TILE_HEIGHT - 1) / TILE_HEIGHT;
    struct job job = {prepared, view, frame, place_of(view->position), across};
    team_run(kept->team, &job, across * down);
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    struct approach *approach = new_approaches(prepared);
    if (!approach)
        return false;
    struct vec nowhere = {set(0.0f), set(0.0f), set(0.0f)};
    for (size_t i = 0; i < count; i++) {
        real shape = set(-1.0f);
        approach_origins(place_of(points + 3 * i), prepared, prepared->all, approach);
        approach_directions(nowhere, prepared, prepared->all, approach);
        distance[i] =
            _mm256_cvtss_f32(sdf(approach, set(0.0f), prepared, prepared->all, set(0.0f), &shape));
        nearest[i] = (int)_mm256_cvtss_f32(shape);
    }
    free(approach);
    return true;
}
