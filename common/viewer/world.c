// Scenes: found, loaded once, written again with another camera.
#include "viewer/world.h"

#include <glob.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MAX_WORLDS = 256 };
static struct world *loaded[MAX_WORLDS];
static int loaded_count;

// Finds common/scenes in a folder above this program. False: there is none.
static bool find_scenes(char path[4096]) {
    ssize_t length = readlink("/proc/self/exe", path, 4000);
    while (length > 0) {
        while (length > 0 && path[--length] != '/')
            continue;
        strcpy(path + length, "/common/scenes");
        if (access(path, R_OK) == 0)
            return true;
    }
    return false;
}

static void read_three(const json_t *object, const char *key, double out[3]) {
    const json_t *array = json_object_get(object, key);
    for (size_t i = 0; i < 3; i++)
        out[i] = json_number_value(json_array_get(array, i));
}

// The scene was checked by scene_load, so that every member is there.
static bool read_camera(struct world *world) {
    json_t *root = json_load_file(world->path, 0, NULL);
    const json_t *camera = json_object_get(root, "camera");
    read_three(camera, "position", world->camera.position);
    read_three(camera, "look_at", world->camera.look_at);
    read_three(camera, "up", world->camera.up);
    read_three(json_object_get(root, "light"), "position", world->camera.light);
    world->camera.flies = world->scene.flight.path.type != PATH_NONE;
    json_decref(root);
    return root != NULL;
}

static bool locate(const char *name, char path[4096]) {
    char folder[4096];
    snprintf(path, 4096, "%s", name);
    if (access(path, R_OK) == 0 || strchr(name, '/') || !find_scenes(folder))
        return access(path, R_OK) == 0;
    static const char *const patterns[] = {"%.3500s/%.400s.json", "%.3500s/animated/%.400s.json",
                                           "%.3500s/%.400s"};
    for (int i = 0; i < 3; i++) {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
        snprintf(path, 4096, patterns[i], folder, name);
#pragma GCC diagnostic pop
        if (access(path, R_OK) == 0)
            return true;
    }
    return false;
}

const char *world_called(const struct world *world) {
    char path[4096];
    const char *name = world->scene.name;
    return locate(name, path) && strcmp(path, world->path) == 0 ? name : world->path;
}

struct world *world_open(const char *name, char *error) {
    char path[4096];
    if (!locate(name, path)) {
        snprintf(
            error, SCENE_ERROR_SIZE,
            "%.300s: no such scene; a path is required, or a name of common/scenes like scene0",
            name);
        return NULL;
    }
    for (int i = 0; i < loaded_count; i++)
        if (strcmp(loaded[i]->path, path) == 0)
            return loaded[i];
    struct world *world = loaded_count < MAX_WORLDS ? calloc(1, sizeof *world) : NULL;
    if (!world) {
        snprintf(error, SCENE_ERROR_SIZE, "out of memory");
        return NULL;
    }
    snprintf(world->path, sizeof world->path, "%s", path);
    bool read = scene_load(path, NULL, &world->scene, error);
    if (read && !read_camera(world)) {
        snprintf(error, SCENE_ERROR_SIZE, "%.300s: changed while it was read", path);
        scene_free(&world->scene);
        read = false;
    }
    if (!read) {
        free(world);
        return NULL;
    }
    world->scene.model.animated = world->scene.model.features.motion;
    return loaded[loaded_count++] = world;
}

struct world *world_next(const struct world *world, int steps, char *error) {
    char pattern[4200];
    glob_t found = {0};
    if (find_scenes(pattern)) {
        size_t end = strlen(pattern);
        strcpy(pattern + end, "/*.json");
        bool some = glob(pattern, 0, NULL, &found) == 0;
        strcpy(pattern + end, "/animated/*.json");
        glob(pattern, some ? GLOB_APPEND : 0, NULL, &found);
    }
    int count = (int)found.gl_pathc, at = steps > 0 ? -1 : 0; // of a scene that is not in the list
    for (int i = 0; i < count; i++)
        if (strcmp(found.gl_pathv[i], world->path) == 0)
            at = i;
    struct world *next = NULL;
    if (count > 0)
        next = world_open(found.gl_pathv[((at + steps) % count + count) % count], error);
    else
        snprintf(error, SCENE_ERROR_SIZE, "no folder common/scenes above this program");
    globfree(&found);
    return next;
}

void worlds_free(void) {
    while (loaded_count > 0) {
        scene_free(&loaded[--loaded_count]->scene);
        free(loaded[loaded_count]);
    }
}

static json_t *three(const double from[3]) {
    return json_pack("[fff]", from[0], from[1], from[2]);
}

bool world_save(const struct world *world, const struct camera *camera, const char *path,
                char *error) {
    json_t *root = json_load_file(world->path, 0, NULL);
    json_t *shot = json_object_get(root, "camera"), *light = json_object_get(root, "light");
    bool set = json_object_set_new(shot, "position", three(camera->position)) == 0 &&
               json_object_set_new(shot, "look_at", three(camera->look_at)) == 0 &&
               json_object_set_new(shot, "up", three(camera->up)) == 0 &&
               json_object_set_new(light, "position", three(camera->light)) == 0;
    json_object_del(shot, "path");
    bool written = set && json_dump_file(root, path, JSON_INDENT(2) | JSON_REAL_PRECISION(17)) == 0;
    if (!written) {
        unlink(path); // a part of it; it was not there before
        snprintf(error, SCENE_ERROR_SIZE, "%.300s: cannot be written", path);
    }
    json_decref(root);
    return written;
}
