// The phase's entry points: which scenes it renders, set-up, and a frame as tiles for the worker threads.
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
#include <math.h>
#include <stdalign.h>
#include <stdio.h>
#include <stdlib.h>

#include "config.h"
#include "driver/variant.h"
#include "path_distance.h"
#include "phase.h"
#include "scene_tables.h"
#include "workers/workers.h"

struct prepared {
    struct model model;
    struct settings settings;
    struct scene_tables *scene; // a frame may change its format, which must fit camera and light
    struct workers *workers;
    int lanes;
    char *settings_text;
};

// Returns why the phase cannot draw the model's shapes, shadows or fog; NULL if it can.
static const char *unsupported_model(const struct model *model) {
    static char error[512];
    if (model->shadows == SHADOWS_SOFT || model->shadows == SHADOWS_IDEAL)
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

// Returns why a sphere cannot be drawn where it is or where its path leads it; NULL if all can.
static const char *unsupported_place(const struct scene *scene) {
    static char error[512];
    const double origin[3] = {0}, *camera = scene->view.position;
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct shape *shape = &scene->model.shapes[i];
        const char *place = shape->path.type == PATH_NONE ? "" : ", or will be on its path";
        double reach = path_distance(shape, origin).furthest + shape->sphere.radius;
        if (!(path_distance(shape, camera).nearest > shape->sphere.radius)) {
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
    const char *reason = unsupported_model(model);
    if (reason)
        return reason;
    if ((reason = unsupported_place(scene)))
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
    return prepared->settings_text;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepared->model = *model;
    tables_set_shapes(prepared->scene, model);
    return true;
}

static struct prepared *allocate(int count) {
    struct prepared *prepared = calloc(1, sizeof *prepared);
    if (prepared) {
        prepared->scene = calloc(1, sizeof *prepared->scene);
        prepared->settings_text = calloc(1, 128);
    }
    if (prepared && prepared->scene && prepared->settings_text &&
        tables_create(prepared->scene, count))
        return prepared;
    if (prepared) {
        free(prepared->scene);
        free(prepared->settings_text);
    }
    free(prepared);
    return NULL;
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct prepared *prepared = allocate(model->shape_count);
    if (!prepared)
        return NULL;
    char error[512];
    settings_read(getenv("STEPWISE_FIXED"), &prepared->settings, error);
    prepared->lanes = variant_here().lanes;
    prepared->workers = workers_start(threads, (size_t)model->shape_count * sizeof(int));
    if (!prepared->workers) {
        phase_release(prepared);
        return NULL;
    }
    // The unit fits the shapes until a frame's camera and light decide.
    int unit = prepared->settings.unit;
    prepared->scene->format = format_make(&prepared->settings, unit < 0 ? 0 : unit);
    phase_update(prepared, model);
    return prepared;
}

void phase_release(struct prepared *prepared) {
    workers_end(prepared->workers);
    tables_free(prepared->scene);
    free(prepared->scene);
    free(prepared->settings_text);
    free(prepared);
}

static int tiles_of(const struct frame *frame) {
    const int wide = BLOCK * TILE_BLOCKS;
    return (frame->width + wide - 1) / wide * ((frame->height + BLOCK - 1) / BLOCK);
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    struct scene_tables *scene = prepared->scene;
    struct format format;
    char error[512];
    // The driver has checked the scene. The camera of this frame may differ by a hair: then the format is kept.
    if (format_fit(&prepared->settings, &prepared->model, view, &format, error)) {
        bool other = format.unit != scene->format.unit;
        scene->format = format;
        if (other)
            tables_set_shapes(scene, &prepared->model);
    }
    if (!directions_fit(&scene->format, view, (double)frame->width / frame->height, error)) {
        fprintf(stderr, "%s\n",
                error); // the driver has checked: only a camera moved by a hair gets here
        return false;
    }
    settings_say(&scene->format, prepared->settings_text);
    tables_set_view(scene, &prepared->model, view, frame);
    alignas(WORKERS_APART) struct job job = {scene, frame}; // all workers read it
    workers_run(prepared->workers, render_tile_in(prepared->lanes), &job, tiles_of(frame));
    return true;
}

// The phase does not march. These are the distances to the spheres as the number format places them.
bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    const struct scene_tables *scene = prepared->scene;
    for (size_t i = 0; i < count; i++) {
        distance[i] = INFINITY;
        for (int k = 0; k < scene->count; k++) {
            double far = 0;
            for (int axis = 0; axis < 3; axis++) {
                double off = points[3 * i + (size_t)axis] -
                             (double)scene->centre[axis][k] * scene->format.length_scale;
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
