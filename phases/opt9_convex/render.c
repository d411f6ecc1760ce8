// The phase's entry points, and the choice between the kernels for 8 and for 16 lanes: the same sources
// ("each_variant" of phase.json), built twice.
#include <math.h>
#include <stdalign.h>
#include <stdlib.h>

#include "counting/flops.h"
#include "driver/variant.h"
#include "placed.h"
#include "threads.h"

// What a tile reads is `prepared`; the team stands behind it.
struct kept {
    struct prepared prepared;
    struct team *team;
    bool sixteen; // lanes, not eight
};

const char *phase_unsupported(const struct scene *scene) {
    (void)scene;
    return NULL;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    place_all(prepared, model);
    return true;
}

static void release(struct kept *kept) {
    if (!kept)
        return;
    struct prepared *prepared = &kept->prepared;
    tree_free(&prepared->tree);
    free(prepared->leaves);
    free(prepared->planes);
    free(prepared->placed);
    free(prepared->eyes);
    free(kept);
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
        kept->team =
            team_start(threads, kept->sixteen ? lanes16_own_size(model) : lanes8_own_size(model));
    if (!kept->team) {
        release(kept);
        return NULL;
    }
    place_all(prepared, model);
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
    bool sixteen;
};

void render_tile(const void *data, int tile, void *own) {
    const struct frame_job *job = data;
    if (job->sixteen)
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
    if (!phase_distances(prepared, 1, view->position, &distance, &nearest))
        return true; // no memory to ask by: a march is always right
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
        {prepared, view, frame, tile_height(prepared, frame),
         prepared->solids && set_eyes(prepared, view) && !within_a_bulb(prepared, view)},
        kept->sixteen};
    team_run(kept->team, &job, kept->sixteen ? lanes16_tiles(&job.job) : lanes8_tiles(&job.job));
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    const struct kept *kept = (const struct kept *)prepared; // its first member
    return kept->sixteen ? lanes16_distances(prepared, count, points, distance, nearest)
                         : lanes8_distances(prepared, count, points, distance, nearest);
}
