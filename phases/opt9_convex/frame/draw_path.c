// See frame/draw_path.h. A forced path is tried on the scene: prepare_shapes and set_local_cameras
// are the only ones to say what a path can draw.
#include "frame/draw_path.h"
#include "frame/prepare.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const NAMES[] = {
    [PATH_DEFAULT] = "", [PATH_LIST] = "list", [PATH_BVH] = "bvh", [PATH_MARCH] = "march"};
enum { PATH_COUNT = sizeof NAMES / sizeof *NAMES };

// Returns PATH_COUNT for a text that names no path.
static int path_named(const char *text) {
    int path = PATH_DEFAULT;
    while (path < PATH_COUNT && strcmp(text ? text : "", NAMES[path]) != 0)
        path++;
    return path;
}

enum draw_path draw_path_forced(void) {
    int path = path_named(getenv("STEPWISE_PATH"));
    return path < PATH_COUNT ? (enum draw_path)path : PATH_DEFAULT;
}

// Returns NULL if the path that `trial` is forced to draws the scene.
static const char *why_not(struct prepared *trial, const struct scene *scene) {
    if (!reserve_prepared(trial, &scene->model))
        return "out of memory";
    prepare_shapes(trial, &scene->model);
    if (trial->path == PATH_MARCH)
        return NULL;
    if (trial->model.shadows == SHADOWS_IDEAL)
        return "light.shadows is \"ideal\": march draws it";
    if (!trial->analytic)
        return "a shape of this scene has no closed form: march draws it";
    if (trial->path == PATH_BVH && !trial->bvh.levels)
        return "a BVH needs a solid, no Mandelbulb, no group, no \"repeat\" and march.max_steps of "
               "256 or more: list draws this scene";
    if (!set_local_cameras(trial, &scene->view, lanes_here()))
        return "the camera should be within march.bounds_radius, above every plane and outside of "
               "every shape's bounding sphere: march draws this scene";
    return NULL;
}

const char *draw_path_unsupported(const struct scene *scene) {
    static char error[512];
    const char *text = getenv("STEPWISE_PATH");
    int path = path_named(text);
    if (path == PATH_DEFAULT)
        return NULL;
    if (path == PATH_COUNT) {
        snprintf(error, sizeof error, "STEPWISE_PATH: \"%.100s\": should be list, bvh or march",
                 text);
        return error;
    }
    struct prepared trial = {.path = (enum draw_path)path};
    const char *reason = why_not(&trial, scene);
    free_prepared(&trial);
    if (!reason)
        return NULL;
    snprintf(error, sizeof error, "STEPWISE_PATH=%s: %s", text, reason);
    return error;
}

const char *draw_path_setting(enum draw_path path) {
    static const char *const settings[] = {NULL, "path=list", "path=bvh", "path=march"};
    return settings[path];
}
