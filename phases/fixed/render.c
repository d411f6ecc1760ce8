// The phase's entry points: what it renders and why not, and a frame as tiles of blocks for the team.
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
#include <math.h>
#include <stdalign.h>
#include <stdio.h>
#include <stdlib.h>

#include "driver/variant.h"
#include "phase.h"
#include "places.h"
#include "threads.h"
#include "trace.h"

struct prepared {
    struct model model;
    struct settings settings;
    struct world
        *world; // its format is the camera's and light's too, so that a frame may change it
    struct team *team;
    int lanes;
    char *said;
};

// Why a model has no closed form here; NULL: it has one.
static const char *no_spheres(const struct model *model) {
    static char error[512];
    if (model->shadows == SHADOWS_SOFT)
        return "soft shadows need the distances along a shadow ray's march, and a closed form has "
               "none; light.shadows \"hard\" or \"none\" is drawn";
    if (model->features.fog)
        return "fog needs an exponential, and the article's integers have none; fog 0 is drawn";
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        double shininess = model->materials[shape->material].shininess;
        if (shape->type != SHAPE_SPHERE ||
            shape->repeat[0] + shape->repeat[1] + shape->repeat[2] > 0) {
            snprintf(error, sizeof error,
                     "shapes[%d] is %s%s; only spheres, not repeated, are drawn", i,
                     shape->type == SHAPE_SPHERE       ? "a repeated "
                     : shape->type == SHAPE_OCTAHEDRON ? "an "
                                                       : "a ",
                     shape_type_name(shape->type));
            return error;
        }
        if (!(shininess == floor(shininess) && shininess < 1024)) {
            snprintf(error, sizeof error,
                     "shapes[%d] has a shininess of %g; powers by repeated squaring are of whole "
                     "numbers from 1 to 1023",
                     i, shininess);
            return error;
        }
    }
    return NULL;
}

// Why a sphere is, or its path leads it, where it is not drawn; NULL: none is.
static const char *out_of_place(const struct scene *scene) {
    static char error[512];
    const double origin[3] = {0}, *camera = scene->view.position;
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct shape *shape = &scene->model.shapes[i];
        const char *place = shape->path.type == PATH_NONE ? "" : ", or will be on its path";
        double reach = places_of(shape, origin).furthest + shape->sphere.radius;
        if (!(places_of(shape, camera).nearest > shape->sphere.radius)) {
            snprintf(error, sizeof error,
                     "the camera is inside of shapes[%d]%s; only a sphere's near side is hit, from "
                     "outside",
                     i, place);
            return error;
        }
        if (!(reach <= scene->model.march.bounds_radius)) {
            snprintf(error, sizeof error,
                     "shapes[%d] leads %g from the origin, beyond bounds_radius %g, which is not "
                     "asked for",
                     i, reach, scene->model.march.bounds_radius);
            return error;
        }
    }
    return NULL;
}

const char *phase_unsupported(const struct scene *scene) {
    static char error[512];
    struct settings settings;
    struct format format;
    const struct model *model = &scene->model;
    if (!settings_read(getenv("STEPWISE_FIXED"), &settings, error))
        return error;
    const char *reason = no_spheres(model);
    if (reason)
        return reason;
    if ((reason = out_of_place(scene)))
        return reason;
    return format_fit(&settings, model, &scene->view, &format, error) ? NULL : error;
}

const char *phase_picture_unsupported(const struct scene *scene, int width, int height) {
    static char error[512];
    struct settings settings;
    struct format format;
    bool fit = settings_read(getenv("STEPWISE_FIXED"), &settings, error) &&
               format_fit(&settings, &scene->model, &scene->view, &format, error) &&
               directions_fit(&format, &scene->view, (double)width / height, error);
    return fit ? NULL : error;
}

const char *phase_settings(const struct prepared *prepared) {
    return prepared->said;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    world_place(prepared->world, model);
    return true;
}

static struct prepared *allocate(int count) {
    struct prepared *prepared = calloc(1, sizeof *prepared);
    if (prepared) {
        prepared->world = calloc(1, sizeof *prepared->world);
        prepared->said = calloc(1, 128);
    }
    if (prepared && prepared->world && prepared->said && world_create(prepared->world, count))
        return prepared;
    if (prepared) {
        free(prepared->world);
        free(prepared->said);
    }
    free(prepared);
    return NULL;
}

static void release(struct prepared *prepared) {
    world_free(prepared->world);
    free(prepared->world);
    free(prepared->said);
    free(prepared);
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct prepared *prepared = allocate(model->shape_count);
    if (!prepared)
        return NULL;
    char error[512];
    settings_read(getenv("STEPWISE_FIXED"), &prepared->settings, error);
    prepared->lanes = variant_here().lanes;
    prepared->team = team_start(threads, (size_t)model->shape_count * sizeof(int));
    if (!prepared->team) {
        release(prepared);
        return NULL;
    }
    const struct settings *s = &prepared->settings;
    // Until a frame's camera and light say what fits.
    int unit = s->unit < 0 ? 0 : s->unit;
    prepared->world->format = (struct format){.bits = s->bits,
                                              .unit = unit,
                                              .scale = ldexp(1, -s->bits),
                                              .length = ldexp(1, unit - s->bits)};
    phase_update(prepared, model);
    return prepared;
}

void phase_release(struct prepared *prepared) {
    team_end(prepared->team);
    release(prepared);
}

// Apart from what the caller writes on its stack: all workers read it.
struct frame_job {
    alignas(APART) struct job job;
    int lanes;
};

void render_tile(const void *data, int tile, void *own) {
    const struct frame_job *job = data;
    TILES(job->lanes, &job->job, tile, own);
}

static int tiles_of(const struct frame *frame) {
    const int wide = BLOCK * TILE_BLOCKS;
    return (frame->width + wide - 1) / wide * ((frame->height + BLOCK - 1) / BLOCK);
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    struct world *world = prepared->world;
    struct format format;
    char error[512];
    // It did fit when the driver asked; a hair more does not turn a frame away.
    if (format_fit(&prepared->settings, &prepared->model, view, &format, error)) {
        bool other = format.unit != world->format.unit;
        world->format = format;
        if (other)
            world_place(world, &prepared->model);
    }
    if (!directions_fit(&world->format, view, (double)frame->width / frame->height, error)) {
        fprintf(stderr, "%s\n", error); // by a hair of the camera's: the driver asked before
        return false;
    }
    format_say(&world->format, prepared->said);
    world_look(world, &prepared->model, view, frame);
    struct frame_job job = {{world, frame}, prepared->lanes};
    team_run(prepared->team, &job, tiles_of(frame));
    return true;
}

// There is no march, so no distance that one would use: that to the spheres as their numbers place them.
bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    const struct world *w = prepared->world;
    for (size_t i = 0; i < count; i++) {
        distance[i] = INFINITY;
        for (int k = 0; k < w->count; k++) {
            double far = 0;
            for (int axis = 0; axis < 3; axis++) {
                double off =
                    points[3 * i + (size_t)axis] - (double)w->centre[axis][k] * w->format.length;
                far += off * off;
            }
            double here = sqrt(far) - prepared->model.shapes[k].sphere.radius;
            if (here < distance[i]) {
                distance[i] = here;
                nearest[i] = k;
            }
        }
    }
    return true;
}
